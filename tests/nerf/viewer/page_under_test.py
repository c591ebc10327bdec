"""A small page of a made-up figure, in a browser that lets nothing pass unseen."""

from __future__ import annotations

import math
import shutil
from base64 import b64encode
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from toonset.camera import Camera
from toonset.nerf.viewer import page as page_module
from toonset.nerf.viewer.scene import Blob, camera_record

SIZE_WH = (60, 90)
COLORS = ([217, 84, 48], [38, 138, 140], [246, 186, 62])
PEN = [20, 10, 30]
# An ellipse of the first paint, a spot of the second in front, the outline in the pen's colour.
RENDERER = """
import { project } from "./camera.js";

export async function createRenderer(canvas, scene) {
  if (!scene.field) throw new Error("no WebGL 2");
  globalThis.shots = [];
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const css = (rgb) => `rgb(${rgb.join(" ")})`;
  return {
    draw(shot) {
      globalThis.shots.push(shot);
      if (globalThis.breaks) throw new Error("context lost");
      [canvas.width, canvas.height] = shot.camera.size;
      const [u, v] = project(shot.camera, scene.figure.target);
      context.fillStyle = css(shot.colors[0]);
      context.strokeStyle = css(shot.ink ?? [0, 0, 0]);
      context.beginPath();
      context.ellipse(u, v, shot.camera.scale * 0.3, shot.camera.scale * 0.8, 0, 0, 7);
      context.fill();
      context.stroke();
      const front = scene.figure.target.map((t, i) => t + [0, 0, 0.3][i]);
      const [x, y, z] = project(shot.camera, front);
      context.fillStyle = css(shot.colors[1]);
      if (z < 0) context.fillRect(x - 4, y - 4, 8, 8);
    },
    read(shot) {
      this.draw(shot);
      return context.getImageData(0, 0, canvas.width, canvas.height);
    },
  };
}
"""


def figure_scene(**changes: Any) -> tuple[dict[str, Any], bytes]:
    """Return numbers and arrays of a page with four drawings: one of each verdict."""
    blob = Blob()
    width, height = SIZE_WH
    whole = np.zeros((3, height, width, 4), np.uint8)
    whole[:, 10:80, 20:40] = [100, 50, 25, 128]  # half covered: its colour is twice as bright
    verdicts = {"ok": 0, "weak": 50, "ambiguous": 180, "failed": -90}
    views = [
        {
            "name": f"{i:03}.png",
            "verdict": verdict,
            "reason": "" if verdict == "ok" else f"why it is {verdict}",
            "yaw": yaw,
            "elevation": 5,
            "sigma": None if verdict == "failed" else {"yaw": 4 + 20 * i, "elevation": 2},
            "camera": camera_record(
                Camera.looking_at(
                    np.array([0.0, 1.0, 0.0]), np.deg2rad(yaw), np.deg2rad(5), 40.0, SIZE_WH
                )
            ),
            "drawing": -1 if verdict == "failed" else i,
        }
        for i, (verdict, yaw) in enumerate(verdicts.items())
    ]
    names = ("red", "teal", "gold")
    scene = {
        "title": "A figure",
        "verdict": {"state": "weak", "reasons": ["no drawing shows the left side"]},
        "layers": ["drawn", "rgb", "palette", "normal", "depth", "labels"],
        "figure": {
            "target": [0.0, 1.0, 0.0],
            "reach": 1.0,
            "fill": 0.94,
            "k": 0.0,
            "turn": [[math.radians(45 * i), 0.0, 0.0] for i in range(8)],
        },
        "palette": [
            {"name": name, "rgb": rgb, "share": share}
            for name, rgb, share in zip(names, COLORS, (0.6, 0.3, 0.1), strict=True)
        ],
        "pen": {"rgb": PEN, "width_px": 2.0},
        "views": views,
        "field": {"any": 1},
        "drawings": {"whole": blob.add(whole)},
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
    def shots(self) -> list[dict[str, Any]]:
        return self.page.evaluate("shots")

    def set(self, **change: Any) -> None:
        self.page.evaluate("change => toonset.store.set(change)", change)

    def rest(self) -> None:
        """Wait until the page has drawn and written its address."""
        self.page.wait_for_timeout(450)

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
              const context = canvas.getContext("2d");
              return [...context.getImageData(u * canvas.width, v * canvas.height, 1, 1).data];
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


def write_page(folder: Path, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Path:
    """Write the page of `figure_scene`, with a renderer that draws an ellipse."""
    modules = folder / "page"
    if not modules.exists():
        shutil.copytree(page_module.FOLDER, modules)
        (modules / "renderer.js").write_text(RENDERER)
    monkeypatch.setattr(page_module, "FOLDER", modules)
    scene, blob = figure_scene(**changes)
    path = folder / "page.html"
    path.write_text(page_module.page_html(scene, blob, _turn()), encoding="utf-8")
    return path


def _turn() -> list[bytes]:
    pictures = []
    for i in range(8):
        file = BytesIO()
        Image.new("RGBA", (20, 20), (30 * i, 90, 90, 255)).save(file, "WEBP", lossless=True)
        pictures.append(file.getvalue())
    return pictures
