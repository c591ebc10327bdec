"""`python -m bench.view RUN...`: a page's pictures beside `render`'s, its first picture, its pace.

Every layer is compared at six cameras of 400 px, over white. Pace is what a page of 400 px shows
while the figure turns by itself, a frame at a time, after 30 frames in which it finds its size.
"""

from __future__ import annotations

import math
import tempfile
import time
from base64 import b64decode
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from playwright.sync_api import Page, sync_playwright

from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.depth_levels import LEVELS, DepthLevels
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.viewer.build import view_html
from toonset.nerf.viewer.scene import camera_record
from toonset.palette.pixels.labels import UNLABELLED

SIDE = 400
SIGHTS = ((0, 0), (60, 0), (150, 15), (210, -10), (300, 0), (90, 25))  # yaw, elevation, degrees
FRAMES, SETTLED = 150, 30
READ = """async shot => {
  const { data } = await toonset.read(shot);
  let text = "";
  for (let i = 0; i < data.length; i += 1024)
    text += String.fromCharCode(...data.subarray(i, i + 1024));
  return btoa(text);
}"""
TURN = """frames => new Promise(done => {
  const times = [];
  const turn = now => {
    times.push(now);
    toonset.store.set({ yaw: (toonset.store.state.yaw + 3) % 360 });
    times.length < frames ? requestAnimationFrame(turn) : done([times, view.width, view.height]);
  };
  requestAnimationFrame(turn);
})"""


def main(runs: Annotated[list[Path], typer.Argument(help="Run folders.")]) -> None:
    """Print a table per run."""
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as place:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox"]
        )
        for run in runs:
            page_file = Path(place) / "page.html"
            page_file.write_text(view_html(run), encoding="utf-8")
            page = browser.new_page(viewport={"width": 426, "height": 800})
            page.add_init_script(
                "new MutationObserver(() => { if (document.querySelector('#poster[hidden]'))"
                " globalThis.first ??= performance.now(); })"
                ".observe(document, { subtree: true, childList: true, attributes: true })"
            )
            page.goto(page_file.as_uri())
            page.wait_for_selector("#poster[hidden]", state="attached", timeout=60_000)
            first = page.evaluate("first")
            print(f"{run}: {page_file.stat().st_size / 1e6:.2f} MB, first picture {first:.0f} ms")
            _pace(page)
            _pictures(page, read_field(run))
            page.close()
        browser.close()


def _pace(page: Page) -> None:
    time.sleep(1)
    times, width, height = page.evaluate(TURN, FRAMES)
    taken = np.diff(times)[SETTLED:]
    print(
        f"  turning: {1000 / taken.mean():.0f} frames a second, median {np.median(taken):.1f} ms, "
        f"longest {taken.max():.1f} ms, at {width} x {height} px"
    )


def _pictures(page: Page, trained: TrainedField) -> None:
    for layer in page.evaluate("toonset.scene.layers"):
        found = [_psnr(page, trained, layer, yaw, elevation) for yaw, elevation in SIGHTS]
        print(f"  {layer}: {' '.join(f'{one:.1f}' for one in found)} dB, least {min(found):.1f}")


def _psnr(page: Page, trained: TrainedField, layer: str, yaw: float, elevation: float) -> float:
    start = turntable(trained, 12, math.radians(elevation), SIDE)[0]
    camera = Camera.looking_at(
        start.target,
        math.radians(yaw),
        math.radians(elevation),
        start.scale,
        (SIDE, SIDE),
        k=start.k,
    )
    shot: dict[str, Any] = {"camera": camera_record(camera), "layer": layer}
    data = np.frombuffer(b64decode(page.evaluate(READ, shot)), np.uint8)
    off = _over_white(data.reshape(SIDE, SIDE, 4)) - _over_white(_rendered(trained, camera, layer))
    return 10 * math.log10(255**2 / max(float(np.mean(off**2)), 1e-9))


def _rendered(trained: TrainedField, camera: Camera, layer: str) -> np.ndarray:
    """Return what `render` shows; labels in the palette's colours, depth as grey of the hull."""
    view = render(trained, camera)
    if layer == "depth":
        scale = DepthLevels.of(trained.hull, [camera])
        near = 1 - (view.depth - scale.nearest) / (scale.unit * (LEVELS - 1))
        grey = np.rint(255 * np.nan_to_num(near))
        return np.dstack([grey, grey, grey, 255.0 * np.isfinite(view.depth)])
    picture = view.picture(layer)
    if layer != "labels":
        return picture
    assert trained.palette is not None
    there = picture != UNLABELLED
    return np.dstack([trained.palette[np.where(there, picture, 0)], 255 * there])


def _over_white(rgba: np.ndarray) -> np.ndarray:
    alpha = rgba[..., 3:].astype(float) / 255
    return rgba[..., :3] * alpha + 255 * (1 - alpha)


if __name__ == "__main__":
    typer.run(main)
