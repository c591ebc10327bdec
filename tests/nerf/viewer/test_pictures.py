"""What the page draws, beside what `toonset render` does: layers, the drawn look, other colours."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from bench.view.compare import psnr, rendered, shown
from tests.nerf.bodies import Hand, body, sheet
from tests.nerf.ellipsoids import QUICK
from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.recolor import recolor_run
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.training import train
from toonset.nerf.viewer.build import run_scene
from toonset.nerf.viewer.page import page_html
from toonset.nerf.viewer.scene import camera_record
from toonset.palette.names import hex_of
from toonset.view import over_white

SIDE = 160
LEAST_DB = {"drawn": 30.0}  # else 33
SIGHTS = ((0.0, 0.0), (70.0, 20.0), (200.0, -15.0))  # yaw, elevation, degrees


@pytest.fixture(scope="module")
def fields() -> dict[str, TrainedField]:
    """Return a field, and one whose surface is that of the character's own body."""
    scene = label_scene(sheet(body(), Hand()))[0]
    shaded = replace(label_scene(sheet(body(), Hand(shadow=0.7)))[0], mannequin=body())
    return {"field": train(scene, QUICK).field, "body": train(shaded, QUICK).field}


@pytest.fixture(scope="module")
def pages(
    browser: Browser, fields: dict[str, TrainedField], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, tuple[TrainedField, Page]]]:
    found = {}
    for name, trained in fields.items():
        scene, blob = run_scene(trained, name, {"verdict": None, "palette": [], "views": []})
        file = tmp_path_factory.mktemp("page") / "page.html"
        file.write_text(page_html(scene, blob, []), encoding="utf-8")
        page = browser.new_page(viewport={"width": 500, "height": 600})
        page.goto(file.as_uri())
        page.wait_for_selector("#poster[hidden]", state="attached", timeout=60_000)
        found[name] = (trained, page)
    yield found
    for _, page in found.values():
        page.close()


def camera_at(trained: TrainedField, yaw: float, elevation: float) -> Camera:
    start = turntable(trained, 36, size=SIDE)[0]
    return Camera.looking_at(
        start.target,
        math.radians(yaw),
        math.radians(elevation),
        0.9 * start.scale,
        (SIDE, SIDE),
        k=start.k,
    )


def drawn_by_page(
    page: Page, trained: TrainedField, camera: Camera, layer: str, **more: Any
) -> np.ndarray:
    assert trained.palette is not None
    return shown(page, camera, layer, **{"colors": trained.palette.tolist(), **more})


@pytest.mark.parametrize("layer", ["drawn", "rgb", "palette", "normal", "depth", "labels"])
@pytest.mark.parametrize("name", ["field", "body"])
def test_a_layer_is_what_render_draws(
    pages: dict[str, tuple[TrainedField, Page]], name: str, layer: str
) -> None:
    trained, page = pages[name]
    for yaw, elevation in SIGHTS:
        camera = camera_at(trained, yaw, elevation)
        found = psnr(drawn_by_page(page, trained, camera, layer), rendered(trained, camera, layer))
        assert found >= LEAST_DB.get(layer, 33.0), (yaw, elevation, found)


@pytest.mark.parametrize("layer", ["drawn", "palette"])
def test_another_colour_changes_only_that_paint(
    pages: dict[str, tuple[TrainedField, Page]], layer: str
) -> None:
    trained, page = pages["field"]
    assert trained.palette is not None
    colors = trained.palette.tolist()
    new = [40, 220, 60]
    changed = recolor_run(trained, [f"{hex_of(tuple(colors[0]))}={hex_of((40, 220, 60))}"])
    camera = camera_at(trained, 40.0, 5.0)
    before = drawn_by_page(page, trained, camera, layer)
    after = drawn_by_page(page, trained, camera, layer, colors=[new, *colors[1:]])
    apart = np.abs(over_white(after) - over_white(before)).max(axis=-1)
    moved = apart > 2 / 255
    view = render(trained, camera)
    assert view.labels is not None
    by_field, by_drawings = view.labels == 0, view.drawn.palette_labels(len(colors)) == 0
    own = by_field | by_drawings if layer == "drawn" else by_field  # the look takes from both
    assert moved[own].mean() > 0.9
    far = ~np.asarray(
        np.lib.stride_tricks.sliding_window_view(np.pad(own, 3), (7, 7)).any(axis=(2, 3))
    )
    assert not moved[far].any()
    assert psnr(after, rendered(changed, camera, layer)) >= LEAST_DB.get(layer, 33.0)


def test_moving_pictures_are_alike(pages: dict[str, tuple[TrainedField, Page]]) -> None:
    for trained, page in pages.values():
        camera = camera_at(trained, 110.0, 10.0)
        still, moving = (
            drawn_by_page(page, trained, camera, "drawn", still=still) for still in (True, False)
        )
        assert psnr(still, moving) > 22


def test_memory_stays_as_it_is_while_it_turns(pages: dict[str, tuple[TrainedField, Page]]) -> None:
    trained, page = pages["field"]
    session = page.context.new_cdp_session(page)
    camera = camera_record(camera_at(trained, 0.0, 0.0))

    def used() -> int:
        session.send("HeapProfiler.collectGarbage")
        return int(page.evaluate("performance.memory.usedJSHeapSize"))

    draw = (
        "([n, camera]) => { for (let i = 0; i < n; i++) toonset.draw({ camera, still: false }); }"
    )
    page.evaluate(draw, [20, camera])
    before = used()
    page.evaluate(draw, [200, camera])
    assert used() < before + 1_000_000


def test_top_level_names_are_unique() -> None:
    folder = Path(__file__).parents[3] / "nerf" / "viewer" / "page"
    names = [
        line.removeprefix("export ").removeprefix("async ").split()[1].split("(")[0]
        for file in folder.glob("*.js")
        for line in file.read_text(encoding="utf-8").splitlines()
        if line.removeprefix("export ")
        .removeprefix("async ")
        .startswith(("const ", "let ", "function ", "class "))
    ]
    assert sorted(names) == sorted(set(names))
