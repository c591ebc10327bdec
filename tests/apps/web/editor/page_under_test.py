"""A made-up sheet of three figures, its bundle's scene, and the page of both in a browser."""

import json
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from playwright.sync_api import Page

from toonset.apps.web.editor.scene import _camera, _mannequin, _mask
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_indexed_png, encode_png
from toonset.html_page import data_url
from toonset.mesh import Mesh
from toonset.view import View

SIZE_WH = (400, 200)
BOXES = ([20, 40, 60, 120], [140, 40, 60, 120], [260, 40, 60, 120])
STUDY = [350, 10, 40, 40]
YAWS = (0.0, 40.0, 180.0)
COLORS = np.array([[200, 40, 40], [40, 80, 200], [240, 220, 60]], np.uint8)
HEXES = ("#c82828", "#2850c8", "#f0dc3c")
VERDICTS = ("ok", "weak", "ambiguous")
HOSTILE = "</script><script>alert('x')</script>\"'\u202e\u05d0\u05d1" + "y" * 10_000

AFTER_LAYOUT = "() => new Promise(done => requestAnimationFrame(() => setTimeout(done)))"


def sheet_png() -> bytes:
    width, height = SIZE_WH
    picture = np.full((height, width, 3), 255, np.uint8)
    for x, y, wide, high in BOXES:
        picture[y : y + high // 2, x : x + wide] = COLORS[0]
        picture[y + high // 2 : y + high, x : x + wide] = COLORS[1]
    picture[170:190, 300:390] = 90  # words below
    return encode_png(picture)


def slab() -> Mesh:
    """Return a body as high as 1.2 times as deep as it is wide by half."""
    corners = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (0, 1.2) for z in (-0.1, 0.1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    return Mesh(corners.astype(float), np.array(faces, dtype=np.int64), name="slab")


def figure_scene(
    body: bool = True, title: str = "A bundle", *, outfits: bool = False
) -> dict[str, Any]:
    """Return the numbers of a page."""
    labels = np.full((128, 68), 255, np.uint8)
    labels[4:64, 4:64], labels[64:124, 4:64] = 0, 1
    groups = [{"rows": [list(BOXES)], "why": "3 figures, 120 px high", "outfits": False}]
    study = [{"box": STUDY, "kind": "study"}] if outfits else []
    if outfits:
        rows = [list(BOXES[:2]), [BOXES[2]]]
        groups = [{"rows": rows, "why": "3 figures in 2 rows", "outfits": True}]
        groups += [{"rows": [[STUDY]], "why": "1 figure", "outfits": False}]
    views = []
    for i, (box, yaw) in enumerate(zip(BOXES, YAWS, strict=True)):
        rgba = np.zeros((128, 68, 4), np.uint8)
        rgba[4:124, 4:64] = 255
        view = View(rgba, (box[0] - 4, box[1] - 4, 68, 128), 1.0, f"{i:03d}.png")
        target = np.array([0.0, 0.6, 0.0])
        camera = Camera.looking_at(target, np.radians(yaw), 0.0, 100.0, (68, 128))
        views.append(
            {
                "name": view.name,
                "box": box,
                "crop": list(view.box),
                "caption": "front" if i == 0 else "",
                "verdict": VERDICTS[i],
                "reason": "" if i == 0 else f"why it is {VERDICTS[i]}",
                "sigma": {"yaw": 5.0 + 20 * i, "elevation": 2.0},
                "yaw": yaw,
                "elevation": 0.0,
                "roll": 0.0,
                "camera": _camera(camera, view),
                "mask": data_url(_mask(view.mask), "image/png"),
                "labels": data_url(encode_indexed_png(labels, COLORS), "image/png"),
            }
        )
    return {
        "schema": "toonset-edit/1",
        "title": title,
        "sheet": {
            "name": title,
            "sha256": "ab" * 32,
            "size": list(SIZE_WH),
            "background": "#ffffff",
            "notes": [],
            "picture": data_url(sheet_png(), "image/png"),
        },
        "groups": groups,
        "group": 1,
        "outfit": "",
        "leftOut": [{"box": [300, 170, 90, 20], "kind": "text"}, *study],
        "verdict": {"state": "ambiguous", "reason": "drawing 3 may be a front"},
        "views": views,
        "mannequin": _mannequin(slab()) if body else None,
        "palette": {
            "colors": [
                {"color": HEXES[0], "name": "red", "share": 0.5},
                {"color": HEXES[1], "name": title, "share": 0.5},
            ],
            "dropped": [{"color": HEXES[2], "name": "gold", "share": 0.01}],
        },
    }


@dataclass
class Editor:
    """An open page, what it said on the console and what it asked of others."""

    page: Page
    noise: list[str] = field(default_factory=list)

    @property
    def said(self) -> dict[str, Any]:
        return self.page.evaluate("toonset.model.said")

    @property
    def views(self) -> list[dict[str, Any]]:
        return self.said.get("views", [])

    @property
    def palette(self) -> dict[str, Any]:
        return self.said.get("palette", {})

    def until(self, expression: str, timeout_s: float = 60) -> None:
        """Wait until an expression is true; the page's policy lets nobody else do so."""
        end = time.monotonic() + timeout_s
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, expression
            self.page.wait_for_timeout(30)

    def mode(self, name: str) -> None:
        self.page.get_by_role("radio", name=name, exact=True).check(force=True)
        self.page.evaluate(AFTER_LAYOUT)  # other tools move the sheet

    def click(self, name: str) -> None:
        self.page.locator("button:visible").get_by_text(name, exact=True).first.click()

    def card(self, word: str, number: int) -> None:
        self.page.get_by_label(f"{word}: drawing {number}").click()

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Return where a pixel of the sheet is on the page."""
        left, top = self.page.evaluate("at => toonset.sheet.place(at)", [x, y])
        return left, top

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag from one pixel of the sheet to another."""
        self.page.mouse.move(*self.place(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.place(*end), steps=5)
        self.page.mouse.up()

    def tap(self, x: float, y: float) -> None:
        self.page.mouse.click(*self.place(x, y))

    def choose(self, *colors: str) -> None:
        for color in colors:
            self.page.get_by_label(f"Choose {color}").check()

    def download(self) -> dict[str, Any]:
        with self.page.expect_download() as download:
            self.page.get_by_role("button", name="Save corrections.json").click()
        return json.loads(download.value.path().read_text(encoding="utf-8"))
