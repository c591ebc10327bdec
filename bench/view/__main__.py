"""`python -m bench.view RUN...`: a page's pictures beside `render`'s, its first picture, its pace.

Every layer is compared at six cameras of 400 px, over white; `moving` is the drawn look while it
moves, beside itself at rest. Frames are drawn one by one at 400 x 400 px, and waited for. Turning
is what a page about as large shows while the figure turns by itself, after 30 frames in which it
finds its size.
"""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from playwright.sync_api import Page

from bench.view.compare import chromium, psnr, rendered, shown
from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.turntable import turntable
from toonset.nerf.run.folder import read_field
from toonset.nerf.viewer.build import view_html
from toonset.nerf.viewer.scene import camera_record

SIDE = 400
SIGHTS = ((0, 0), (60, 0), (150, 15), (210, -10), (300, 0), (90, 25))  # yaw, elevation, degrees
FRAMES, SETTLED, ALONE = 150, 30, 20
FIRST = """new MutationObserver(() => {
  if (document.querySelector("#poster[hidden]")) globalThis.first ??= performance.now();
}).observe(document, { subtree: true, childList: true, attributes: true })"""
TURN = """frames => new Promise(done => {
  const times = [];
  const turn = now => {
    times.push(now);
    toonset.store.set({ yaw: (toonset.store.state.yaw + 3) % 360 });
    times.length < frames ? requestAnimationFrame(turn) : done([times, view.width, view.height]);
  };
  requestAnimationFrame(turn);
})"""
FRAME = """([camera, still]) => {
  const gl = view.getContext("webgl2");
  const start = performance.now();
  toonset.draw({ camera, layer: "drawn", still });
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return performance.now() - start;
}"""


def main(runs: Annotated[list[Path], typer.Argument(help="Run folders.")]) -> None:
    """Print figures of each run's page."""
    with chromium() as browser, tempfile.TemporaryDirectory() as place:
        for run in runs:
            file = Path(place) / "page.html"
            file.write_text(view_html(run), encoding="utf-8")
            page = browser.new_page(viewport={"width": 426, "height": 800})
            page.add_init_script(FIRST)
            page.goto(file.as_uri())
            page.wait_for_selector("#poster[hidden]", state="attached", timeout=60_000)
            first, size = page.evaluate("first"), file.stat().st_size / 1e6
            print(f"{run}: {size:.2f} MB, first picture {first:.0f} ms")
            trained = read_field(run)
            _pace(page, trained)
            _pictures(page, trained)
            page.close()


def _pace(page: Page, trained: TrainedField) -> None:
    time.sleep(1)  # the first picture at rest is drawn
    times, width, height = page.evaluate(TURN, FRAMES)
    taken = np.diff(times)[SETTLED:]
    print(
        f"  turning: {1000 / taken.mean():.0f} frames a second, median {np.median(taken):.1f} ms, "
        f"longest {taken.max():.1f} ms, at {width} x {height} px"
    )
    if trained.drawings is None:
        return
    cameras = [camera_record(_camera(trained, 18 * i, 0)) for i in range(ALONE)]
    for still, name in ((False, "moving"), (True, "at rest")):
        alone = [page.evaluate(FRAME, [camera, still]) for camera in cameras]
        print(f"  a frame {name}: median {np.median(alone):.0f} ms, longest {max(alone):.0f} ms")


def _pictures(page: Page, trained: TrainedField) -> None:
    cameras = [_camera(trained, yaw, elevation) for yaw, elevation in SIGHTS]
    for layer in page.evaluate("toonset.scene.layers"):
        found = [psnr(shown(page, c, layer), rendered(trained, c, layer)) for c in cameras]
        _say(layer, found)
    if trained.drawings is not None:
        pairs = [[shown(page, c, "drawn", still=still) for still in (False, True)] for c in cameras]
        _say("moving", [psnr(*pair) for pair in pairs])


def _say(name: str, found: list[float]) -> None:
    print(f"  {name}: {' '.join(f'{one:.1f}' for one in found)} dB, least {min(found):.1f}")


def _camera(trained: TrainedField, yaw: float, elevation: float) -> Camera:
    start = turntable(trained, 12, math.radians(elevation), SIDE)[0]
    angles = math.radians(yaw), math.radians(elevation)
    return Camera.looking_at(start.target, *angles, start.scale, (SIDE, SIDE), k=start.k)


if __name__ == "__main__":
    typer.run(main)
