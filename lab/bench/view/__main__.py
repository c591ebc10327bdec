"""`python -m lab.bench.view RUN...`: what a page costs, and how like `render` its pictures are.

Seconds are of the processor, those of `toonset render` on the same views beside them. Every
EVERY-th view is compared over white, as it is and with the palette's first colour changed. Then
every paint is recoloured in turn and counted is what it leaves: see `crumbs`, and `hues` for
drawings that are shaded throughout. Pace is that of a figure which turns by 5 degrees a frame.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from playwright.sync_api import Page

from lab.bench.view.compare import chromium, psnr, shown
from lab.bench.view.crumbs import left_behind
from lab.bench.view.hues import left_hues
from toonset.apps.web.viewer.page import view_html
from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.layered_views.build import cameras_of
from toonset.nerf.layered_views.ring import ring_through
from toonset.nerf.render.recolor import recolor_run
from toonset.nerf.render.turntable import drawn_on_sheet
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.palette.names import hex_of

EVERY, FRAMES = 6, 100
NEW = (40, 220, 60)
YAWS, FACTORS = (0, 200), (1, 2, 4)  # degrees; sizes of saved pictures
FIRST = """new MutationObserver(() => {
  if (document.querySelector("#poster[hidden]")) globalThis.first ??= performance.now();
}).observe(document, { subtree: true, childList: true, attributes: true })"""
TURN = """frames => new Promise(done => {
  const start = performance.now();
  const turn = () => {
    toonset.store.set({ yaw: toonset.store.state.yaw + 5 });
    frames-- ? requestAnimationFrame(turn) : done(performance.now() - start);
  };
  requestAnimationFrame(turn);
})"""


def main(runs: Annotated[list[Path], typer.Argument(help="Run folders.")]) -> None:
    """Print figures of each run's page."""
    with chromium() as browser, tempfile.TemporaryDirectory() as place:
        for run in runs:
            file, began = Path(place) / "page.html", time.process_time()
            file.write_text(view_html(run), encoding="utf-8")
            seconds = time.process_time() - began
            page = browser.new_page(  # that does not turn by itself between two saved pictures
                viewport={"width": 1000, "height": 800}, reduced_motion="reduce"
            )
            page.add_init_script(FIRST)
            page.goto(file.as_uri())
            page.wait_for_selector("#poster[hidden]", state="attached", timeout=60_000)
            first, size = page.evaluate("first"), file.stat().st_size / 1e6
            page.wait_for_timeout(2000)
            pace = FRAMES * 1000 / page.evaluate(TURN, FRAMES)
            print(f"{run}: {size:.2f} MB, first picture {first:.0f} ms, {pace:.0f} frames a second")
            _pictures(page, read_field(run), seconds)
            page.close()


def _pictures(page: Page, trained: TrainedField, seconds: float) -> None:
    ring = ring_through([drawing.camera for drawing in drawn_on_sheet(trained)])
    cameras, began = cameras_of(trained, ring), time.process_time()
    for camera in cameras:
        view = render(trained, camera)
        view.picture()
    print(f"  {seconds:.1f} CPU s, of which drawing {time.process_time() - began:.1f}")
    layer = page.evaluate("toonset.scene.layers[0]")
    _compare(page, trained, cameras, layer)
    if trained.palette is None:
        return
    old = trained.palette.tolist()
    changed = recolor_run(trained, [f"{hex_of(tuple(old[0]))}={hex_of(NEW)}"])
    _compare(page, changed, cameras, layer, colors=[list(NEW), *old[1:]])
    if trained.drawings is not None and trained.drawings.ramps:
        _left_hues(page, trained, cameras[:: 2 * EVERY])
    else:
        _left(page)


def _left_hues(page: Page, trained: TrainedField, cameras: Sequence[Camera]) -> None:
    """Print what recolouring each paint leaves of its hue."""
    assert trained.palette is not None
    old = trained.palette.tolist()
    for number, rgb in enumerate(old):
        changed = recolor_run(trained, [f"{hex_of(tuple(rgb))}={hex_of(NEW)}"])
        colors = [list(NEW) if i == number else one for i, one in enumerate(old)]
        found = [
            left_hues(
                render(trained, camera).picture(),
                shown(page, 2 * EVERY * i, colors=colors),
                render(changed, camera).picture(),
            )
            for i, camera in enumerate(cameras)
        ]
        judged, left, shining = (
            sum(getattr(one, name) for one in found) for name in ("judged", "old", "shining")
        )
        name = hex_of(tuple(rgb))
        print(f"  {name}: of {judged} pixels {left} keep the old hue, {shining} shine")


def _left(page: Page) -> None:
    """Print what recolouring each paint leaves in saved pictures."""
    found = list(left_behind(page, YAWS, FACTORS))
    for factor in FACTORS:
        own = [one for one in found if one.factor == factor]
        judged, old, shining = (
            sum(getattr(one, name) for one in own) for name in ("judged", "old", "shining")
        )
        print(f"  {factor}x: of {judged} pixels {old} keep an old colour, {shining} shine")


def _compare(
    page: Page, trained: TrainedField, cameras: Sequence[Camera], layer: str, **more: Any
) -> None:
    found = []
    for i in range(0, len(cameras), EVERY):
        own = render(trained, cameras[i]).picture(layer)
        found.append(psnr(shown(page, i, layer, **more), own))
    name = "recoloured" if more else layer
    print(f"  {name}: mean {sum(found) / len(found):.1f} dB, least {min(found):.1f}")


if __name__ == "__main__":
    typer.run(main)
