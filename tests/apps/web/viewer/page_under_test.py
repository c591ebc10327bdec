"""A small page of a made-up figure, in a browser that lets nothing pass unseen."""

from __future__ import annotations

import math
import time
from base64 import b64encode
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Page

from toonset.apps.web.viewer.page import Blob, page_html
from toonset.camera import Camera
from toonset.nerf.layered_views.layered import layered
from toonset.nerf.layered_views.lossy import webp
from toonset.nerf.layered_views.records import (
    camera_record,
    coding,
    layered_record,
    origins_record,
    picture_record,
)
from toonset.nerf.look.drawn_view import DRAWN, GUESSED, MIRRORED, DrawnView
from toonset.nerf.look.outline import Outline

SIZE_WH = (60, 90)
COLORS = ([217, 84, 48], [38, 138, 140], [246, 186, 62])
PEN = [20, 10, 30]
SIDE = 120  # of the views
TARGET = np.array([0.0, 1.0, 0.0])
HEIGHTS = (0.0, 30.0)  # of the rings, degrees
VERDICTS = {"ok": 0, "weak": 50, "ambiguous": 180, "failed": -90}  # and yaws, degrees


def sight_camera(yaw: float, elevation: float) -> Camera:
    """Return the camera of a view, from degrees."""
    return Camera.looking_at(
        TARGET, math.radians(yaw), math.radians(elevation), 0.47 * SIDE, (SIDE, SIDE)
    )


def drawn_ellipse(camera: Camera) -> DrawnView:
    """Return an ellipse of the first paint in an outline, a spot of the second in front."""
    (x, y) = (camera.pixel_grid()[..., axis] - camera.center[axis] for axis in (0, 1))
    away = np.hypot(x / (0.3 * camera.scale), y / (0.8 * camera.scale))
    alpha = np.clip((1 - away) * 10, 0, 1).astype(np.float32)
    ink = np.where(away > 0.85, alpha, 0).astype(np.float32)
    pixels, depth, _ = camera.project(TARGET[None] + [0, 0, 0.3])
    near = np.abs(camera.pixel_grid() - pixels[0]).max(axis=-1) < 6
    labels = (near & (depth[0] < 0)).astype(np.uint8)
    paint = (np.array(COLORS, np.float32) / 255)[labels]
    line = np.array(PEN, np.float32) / 255
    rgb = paint * (alpha - ink)[..., None] + ink[..., None] * line
    source = np.where(x + 0 * y < 0, np.where(y < 0, MIRRORED, GUESSED), DRAWN).astype(np.uint8)
    return DrawnView(rgb, alpha, ink, labels, paint, source)


def _sight(yaw: float, elevation: float, level: int, whole: bool) -> dict[str, Any]:
    view = drawn_ellipse(sight_camera(yaw, elevation))
    red, green, blue = PEN
    found = layered(view, np.array(COLORS, np.uint8), Outline((red, green, blue), 0.1 * SIDE))
    assert found is not None
    layers: dict[str, Any] = {}
    layers["drawn"] = {**(layered_record(found) or {}), "origins": origins_record(view, found)}
    for i, layer in enumerate(("rgb", "normal", "depth") if whole else ()):
        grey = np.full((SIDE, SIDE, 1), 40 * i, np.uint8)
        opaque = 255 * (view.alpha > 0.5).astype(np.uint8)
        layers[layer] = picture_record(np.dstack([grey, grey, grey, opaque])[::2, ::2], 2)
    angles = [math.radians(yaw), math.radians(elevation), 0.0]
    return {"angles": angles, "level": level, "layers": layers}


@cache
def _sights() -> list[dict[str, Any]]:
    """Return a ring of steps of 5 degrees, a higher one of 30, and the drawings' own views."""
    rings = [
        _sight(step * i, elevation, level, i % 3 == 0)
        for level, (elevation, step) in enumerate(zip(HEIGHTS, (5, 30), strict=True))
        for i in range(360 // step)
    ]
    return [*rings, *(_sight(yaw, 5, -1, True) for yaw in VERDICTS.values())]


def figure_scene(**changes: Any) -> tuple[dict[str, Any], bytes]:
    """Return numbers and pictures of a page with four drawings: one of each verdict."""
    blob = Blob()
    width, height = SIZE_WH
    whole = np.zeros((height, width, 4), np.uint8)
    whole[10:80, 20:40] = [200, 100, 50, 128]
    sights = _sights()
    views = [
        {
            "name": f"{i:03}.png",
            "verdict": verdict,
            "reason": "" if verdict == "ok" else f"why it is {verdict}",
            "yaw": yaw,
            "elevation": 5,
            "sigma": None if verdict == "failed" else {"yaw": 4 + 20 * i, "elevation": 2},
            "camera": camera_record(
                Camera.looking_at(TARGET, np.deg2rad(yaw), np.deg2rad(5), 40.0, SIZE_WH)
            ),
            "sight": len(sights) - len(VERDICTS) + i,
            "picture": blob.keep(webp(whole, 100)),
        }
        for i, (verdict, yaw) in enumerate(VERDICTS.items())
    ]
    names = ("red", "teal", "gold")
    scene = {
        "title": "A figure",
        "verdict": {"state": "weak", "reasons": ["no drawing shows the left side"]},
        "layers": ["drawn", "rgb", "normal", "depth"],
        "figure": {
            "target": TARGET.tolist(),
            "reach": 1.0,
            "fill": 0.94,
            "k": 0.0,
            "size": SIDE,
            "elevations": list(HEIGHTS),
            "start": 0,
        },
        "palette": [
            {"name": name, "rgb": rgb, "share": share}
            for name, rgb, share in zip(names, COLORS, (0.6, 0.3, 0.1), strict=True)
        ],
        "paints": [*COLORS, PEN],
        "coding": coding(),
        "pen": {"rgb": PEN},
        "views": views,
        "sights": [blob.keep(sight) for sight in sights],
        **changes,
    }
    return scene, blob.deflated()


@dataclass
class Viewer:
    """An open page, what it said on the console and what it asked of the network."""

    page: Page
    noise: list[str] = field(default_factory=list)

    @property
    def state(self) -> dict[str, Any]:
        return self.page.evaluate("toonset.store.state")

    @property
    def shot(self) -> dict[str, Any]:
        return self.page.evaluate("toonset.shot()")

    @property
    def sight(self) -> dict[str, Any]:
        return self.page.evaluate("toonset.scene.sights[toonset.shot().sight]")

    def set(self, **change: Any) -> None:
        self.page.evaluate("change => toonset.store.set(change)", change)

    def rest(self) -> None:
        """Wait until the page has drawn and written its address."""
        self.page.wait_for_timeout(450)

    def until(self, condition: str, limit_s: float = 30.0) -> None:
        """Wait until a condition of JavaScript holds.

        The browser's own wait asks again by `eval`, which the page's policy forbids: it
        fails wherever the condition does not hold at once.

        Raises:
            TimeoutError: it did not hold in time.
        """
        end = time.monotonic() + limit_s
        while not self.page.evaluate(f"Boolean({condition})"):
            if time.monotonic() > end:
                raise TimeoutError(f"{condition} did not hold in {limit_s:g} s")
            self.page.wait_for_timeout(20)

    def middle(self) -> tuple[float, float]:
        box = self.page.locator("#view").bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag(self, x: float, y: float, pause_ms: float = 100) -> None:
        """Drag the figure's middle with the mouse; by default it is held before it is let go."""
        mouse, (left, top) = self.page.mouse, self.middle()
        mouse.move(left, top)
        mouse.down()
        mouse.move(left + x, top + y, steps=5)
        self.page.wait_for_timeout(pause_ms)
        mouse.up()

    def pixel(self, u: float, v: float) -> list[int]:
        """Return the stage's colour at shares of its width and height."""
        return self.page.evaluate(
            """([u, v]) => {
              const canvas = document.getElementById("view");
              const copy = new OffscreenCanvas(1, 1).getContext("2d");
              copy.drawImage(canvas, -Math.floor(u * canvas.width), -Math.floor(v * canvas.height));
              return [...copy.getImageData(0, 0, 1, 1).data];
            }""",
            [u, v],
        )

    def drop(self, name: str, data: bytes) -> str:
        """Drop a file on the page; return what the page says."""
        self.page.evaluate(
            """([name, base64]) => {
              const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
              document.getElementById("message").textContent = "";
              const dataTransfer = new DataTransfer();
              dataTransfer.items.add(new File([bytes], name));
              document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
            }""",
            [name, b64encode(data).decode()],
        )
        self.page.wait_for_selector("#message:not(:empty)")
        return self.page.locator("#message").inner_text()


def write_page(folder: Path, *, blob: bytes | None = None, **changes: Any) -> Path:
    """Write the page of `figure_scene`; with other bytes than its pictures if there are any."""
    scene, own = figure_scene(**changes)
    path = folder / "page.html"
    poster = webp(np.full((20, 20, 4), 90, np.uint8))
    path.write_text(page_html(scene, own if blob is None else blob, poster), encoding="utf-8")
    return path
