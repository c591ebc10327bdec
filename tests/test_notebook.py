"""What notebooks show: small, escaped, and never an error."""

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import toonset as ts
from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.images.picture import encode_png as encoded
from toonset.notebook import MOST_ROWS, table
from toonset.view import small_png

MOST = 300_000
VOID = ("img",)


class Page(HTMLParser):
    """Tags and words of a page; what is opened is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.words = ""
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.open += [] if tag in VOID else [tag]
        assert all(not name.startswith("on") for name, _ in attrs)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += f"{data} "


def noise(height: int, width: int) -> np.ndarray:
    rgba = np.random.default_rng(0).integers(0, 256, (height, width, 4), dtype=np.uint8)
    rgba[..., 3] |= 128
    return rgba


def shown(data: bytes) -> np.ndarray:
    return decode_rgba(data, Path("shown.png"))


def test_a_view_is_its_drawing_made_small() -> None:
    view = ts.View(noise(60, 40), (0, 0, 40, 60), 0.0, "000.png")
    np.testing.assert_array_equal(shown(view._repr_png_()), view.rgba)
    large = ts.View(noise(1500, 1000), (0, 0, 1000, 1500), 0.0, "000.png")
    data = large._repr_png_()
    assert len(data) < MOST
    height, width = shown(data).shape[:2]
    assert height / width == pytest.approx(1.5, rel=0.02)
    assert 200 < height <= 480
    thin = small_png(noise(3000, 1))
    assert shown(thin).shape[:2] == (480, 1)


def test_a_bundle_is_a_table_of_its_views(bundle: Path) -> None:
    found = ts.read_bundle(bundle)
    page = Page(found._repr_html_())
    assert page.tags.count("img") == len(found.scene.frames) == page.tags.count("tr") - 1
    for frame in found.scene.frames:
        assert frame.name in page.words
    assert " ok " in page.words
    assert "°" in page.words


def test_a_bundle_without_verdicts_or_with_broken_ones(bundle: Path) -> None:
    found = ts.read_bundle(bundle)
    (bundle / "calibration.json").write_text("{")
    broken = found._repr_html_()
    (bundle / "calibration.json").unlink()
    assert broken == found._repr_html_()
    assert " ok " not in Page(broken).words
    (bundle / "transforms.json").unlink()  # the folder may be gone
    assert found._repr_html_() == broken


def test_foreign_names_are_text(bundle: Path) -> None:
    found = ts.read_bundle(bundle)
    [first, *others] = found.scene.frames
    bad = replace(first, name="<script>alert('x')</script>")
    hostile = replace(
        found, folder=Path("<b onclick=1>&amp;"), scene=replace(found.scene, frames=(bad, *others))
    )
    page = Page(hostile._repr_html_())
    assert not {"script", "b"} & set(page.tags)
    assert "<script>alert('x')</script>" in page.words


def test_many_large_views_and_long_texts_stay_small(bundle: Path) -> None:
    found = ts.read_bundle(bundle)
    frames = [
        replace(found.scene.frames[0], name=f"{i:03d}.png", rgba=noise(300, 300))
        for i in range(MOST_ROWS + 3)
    ]
    html = replace(found, scene=replace(found.scene, frames=tuple(frames)))._repr_html_()
    assert len(html) < MOST
    page = Page(html)
    assert page.tags.count("img") == MOST_ROWS
    assert "and 3 more" in page.words
    words = Page(table("long", ("a",), [["x" * 10_000]])).words
    assert "x" * 299 + "…" in words
    assert "x" * 300 not in words


def test_a_run_and_a_rendering(run: Path) -> None:
    field = ts.read_run(run)
    html = field._repr_html_()
    assert len(html) < MOST
    page = Page(html)
    assert field.palette is not None
    assert page.tags.count("tr") == 1 + len(field.palette)
    assert page.tags.count("img") == 1  # the drawings
    plain = Page(replace(field, palette=None, drawings=None)._repr_html_())
    assert "no colours" in plain.words
    view = ts.render(field, ts.turntable(field, 1)[0])
    assert view._repr_png_() == small_png(view.picture("drawn"))
    assert encoded(shown(view._repr_png_())) == view.png("drawn")[0] == view.png()[0]
    assert view.png("drawn")[0] != view.png("rgb")[0]


def test_a_training_is_four_views_of_it(bundle: Path) -> None:
    scene = ts.read_bundle(bundle).scene
    result = ts.train(scene, ts.TrainOptions(steps=20, device="cpu"), threads=1)
    data = result._repr_png_()
    assert len(data) < MOST
    height, width = shown(data).shape[:2]
    assert width == pytest.approx(4 * height, abs=4)
