"""What the page shows, beside what `toonset render` draws: layers, other colours, lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jaxtyping import Bool, UInt8
from playwright.sync_api import Browser, Page

from lab.bench.view.compare import psnr, shown
from lab.bench.view.crumbs import left_behind
from tests.nerf.bodies import Hand, body, sheet
from tests.nerf.ellipsoids import QUICK
from toonset.apps.web.viewer.page import page_of
from toonset.camera import Camera
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.layered_views.build import SheetDrawings, cameras_of, views_of_field
from toonset.nerf.layered_views.ring import Ring, ring_through
from toonset.nerf.layered_views.sights import SHRINK
from toonset.nerf.look.drawn_view import SOLID
from toonset.nerf.render.recolor import recolor_run
from toonset.nerf.render.turntable import drawn_on_sheet
from toonset.nerf.render.views import render
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.training import train
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.raster import dilate
from toonset.view import over_white

SIDE, VIEWS = 160, 12
NEW = (40, 220, 60)
NEAR = 0.05  # OKLab: a colour so near to another is its like
# WebP keeps every other pixel's hue, of which normals of so coarse a field are made
LEAST_DB = {"drawn": 36.0, "rgb": 33.0, "normal": 27.0, "depth": 33.0}


@dataclass(frozen=True, eq=False)
class Shown:
    """A field's page in a browser, and its views."""

    trained: TrainedField
    page: Page
    ring: Ring
    cameras: tuple[Camera, ...]

    @property
    def colors(self) -> list[list[int]]:
        assert self.trained.palette is not None
        return self.trained.palette.tolist()

    def recolored(self, number: int) -> tuple[TrainedField, list[list[int]]]:
        """Return the field with one colour changed, and the page's colours then."""
        old = self.colors
        red, green, blue = old[number]
        changed = recolor_run(self.trained, [f"{hex_of((red, green, blue))}={hex_of(NEW)}"])
        return changed, [list(NEW) if i == number else rgb for i, rgb in enumerate(old)]


@pytest.fixture(scope="module")
def pages(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Shown]]:
    """Yield the page of a field, and of one whose surface is the character's own body."""
    scene = label_scene(sheet(body(), Hand()))[0]
    shaded = replace(label_scene(sheet(body(), Hand(shadow=0.7)))[0], mannequin=body())
    found = {}
    for name, one in {"field": scene, "body": shaded}.items():
        trained = train(one, QUICK).field
        drawn = SheetDrawings.of(drawn_on_sheet(trained), tmp_path_factory.mktemp("none"))
        assert trained.palette is not None
        colors = trained.palette.tolist()
        palette = [{"name": str(rgb), "rgb": rgb, "share": 0.0} for rgb in colors]
        about = {"title": name, "verdict": None, "palette": palette}
        file = tmp_path_factory.mktemp("page") / "page.html"
        views = views_of_field(trained, about, drawn, SIDE, VIEWS)
        file.write_text(page_of(views), encoding="utf-8")
        page = browser.new_page(viewport={"width": 500, "height": 600})
        page.goto(file.as_uri())
        page.wait_for_selector("#poster[hidden]", state="attached", timeout=60_000)
        ring = ring_through(drawn.cameras, VIEWS)
        found[name] = Shown(trained, page, ring, cameras_of(trained, ring, SIDE))
    yield found
    for one in found.values():
        one.page.close()


@pytest.mark.parametrize("layer", LEAST_DB)
@pytest.mark.parametrize("name", ["field", "body"])
def test_a_layer_is_what_render_draws(pages: dict[str, Shown], name: str, layer: str) -> None:
    one = pages[name]
    for i, camera in enumerate(one.cameras):
        if layer == "drawn" or one.ring.layered[i]:
            wanted = at_its_size(layer, one.trained, camera)
            found = psnr(shown(one.page, i, layer, side=len(wanted)), wanted)
            assert found >= LEAST_DB[layer], (i, found)


def at_its_size(layer: str, trained: TrainedField, camera: Camera) -> UInt8[np.ndarray, "h w 4"]:
    """Return a layer as `render` draws it at the size that the page has it at: half, or all."""
    if layer == "drawn":
        return render(trained, camera).picture(layer)
    return render(trained, camera.resized(1 / SHRINK)).picture(layer)


@pytest.mark.parametrize("name", ["field", "body"])
def test_every_drawing_is_one_of_the_views(pages: dict[str, Shown], name: str) -> None:
    one = pages[name]
    views = one.page.evaluate("toonset.scene.views")
    for view, own in zip(views, drawn_on_sheet(one.trained), strict=True):
        camera = one.cameras[view["sight"]]
        np.testing.assert_allclose(camera.rotation, own.camera.rotation, atol=1e-9)


@pytest.mark.parametrize("name", ["field", "body"])
def test_another_colour_is_as_render_has_it_and_leaves_nothing_of_the_old(
    pages: dict[str, Shown], name: str
) -> None:
    one = pages[name]
    front = render(one.trained, one.cameras[0]).drawn.palette_labels(len(one.colors))
    for number in np.flatnonzero(np.bincount(front[front < 255]) > 0.1 * (front < 255).sum()):
        changed, colors = one.recolored(int(number))
        old = one.colors[number]
        for i, camera in list(enumerate(one.cameras))[::3]:
            after = shown(one.page, i, colors=colors)
            assert psnr(after, render(changed, camera).picture()) >= 30.0, (number, i)
            left = like(after, old) & (after[..., 3] == 255)
            others = [like(np.array([[rgb]], np.uint8), old)[0, 0] for rgb in colors]
            assert any(others) or not left.any(), (number, i, int(left.sum()))


def test_no_paint_leaves_anything_in_a_saved_picture(pages: dict[str, Shown]) -> None:
    page = pages["field"].page
    found = list(left_behind(page, (0, 60, 180), (1, 2, 4)))
    assert {one.paint for one in found} == {str(rgb) for rgb in pages["field"].colors}
    for one in found:
        assert one.judged > 1000
        assert (one.old, one.shining) == (0, 0), one


@pytest.mark.parametrize("layer", ["drawn", "palette"])
def test_another_colour_changes_only_that_paint(pages: dict[str, Shown], layer: str) -> None:
    one = pages["field"]
    _, colors = one.recolored(0)
    i = int(np.flatnonzero(one.ring.layered)[1])
    after, before = (shown(one.page, i, layer, **more) for more in ({"colors": colors}, {}))
    moved = np.abs(over_white(after) - over_white(before)).max(axis=-1) > 2 / 255
    if layer == "palette":
        labels = render(one.trained, one.cameras[i].resized(1 / SHRINK)).labels
        assert labels is not None
        own, near = (
            np.kron(part, np.ones((SHRINK, SHRINK), bool))
            for part in (labels == 0, dilate(labels == 0, 3))
        )
    else:
        own = render(one.trained, one.cameras[i]).drawn.palette_labels(len(colors)) == 0
        near = dilate(own, 3)
    assert moved[own].mean() > 0.9
    assert not moved[~near].any()


def test_lines_are_switched_off(pages: dict[str, Shown]) -> None:
    one = pages["field"]
    assert one.trained.drawings is not None
    pen = one.trained.drawings.pen
    assert pen is not None
    for i, camera in list(enumerate(one.cameras))[1::3]:
        view = render(one.trained, camera).drawn
        line = (view.ink > 0.9 * view.alpha) & (view.alpha >= SOLID)
        if i in one.ring.own:  # a drawing's own lines lie a little beside
            continue
        with_lines, without = shown(one.page, i), shown(one.page, i, lines=False)
        assert like(with_lines, pen.rgb)[line].mean() > 0.9
        assert like(without, pen.rgb)[line].mean() < 0.1
        np.testing.assert_array_equal(with_lines[..., 3], without[..., 3])
        blue = shown(one.page, i, pen=[0, 0, 255])
        assert like(blue, (0, 0, 255))[line].mean() > 0.9


def test_memory_stays_as_it_is_while_it_turns(pages: dict[str, Shown]) -> None:
    page = pages["field"].page
    session = page.context.new_cdp_session(page)

    def used() -> int:
        session.send("HeapProfiler.collectGarbage")
        return int(page.evaluate("performance.memory.usedJSHeapSize"))

    turn = """async n => { for (let i = 0; i < n; i++) {
        toonset.store.set({ yaw: 30 * i });
        await new Promise(requestAnimationFrame);
    } }"""
    page.evaluate(turn, 24)
    before = used()
    page.evaluate(turn, 120)
    assert used() < before + 1_000_000


def test_top_level_names_are_unique() -> None:
    folder = Path(__file__).parents[4] / "apps" / "web" / "viewer" / "page"
    names = [
        line.removeprefix("export ").removeprefix("async ").split()[1].split("(")[0]
        for file in folder.glob("*.js")
        for line in file.read_text(encoding="utf-8").splitlines()
        if line.removeprefix("export ")
        .removeprefix("async ")
        .startswith(("const ", "let ", "function ", "class "))
    ]
    assert sorted(names) == sorted(set(names))


def like(picture: UInt8[np.ndarray, "h w _"], rgb: Any) -> Bool[np.ndarray, "h w"]:
    """Return which pixels have a colour like another."""
    flat = picture[..., :3].reshape(-1, 3)
    off = np.linalg.norm(oklab_from_rgb(flat) - oklab_from_rgb(np.array([rgb], np.uint8)), axis=1)
    return (off < NEAR).reshape(picture.shape[:2])
