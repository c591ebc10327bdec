"""See-through paint counts with its own colour; soft rims and what matting leaves do not."""

import numpy as np
import pytest

from toonset.palette.extract import extract_palette, label_image
from toonset.palette.pixels.opacity import opaque_inside

TEAL, RED = (38, 138, 140), (217, 84, 48)


def figure(alpha: np.ndarray | int) -> np.ndarray:
    """Return a red figure whose lower half is teal of some opacity, with a soft rim."""
    rgba = np.zeros((80, 60, 4), dtype=np.uint8)
    rgba[8:72, 8:52] = (*RED, 255)
    rgba[40:72, 8:52, :3] = TEAL
    rgba[40:72, 8:52, 3] = alpha
    rgba[8:72, [8, 51], 3] = 120
    return rgba


@pytest.mark.parametrize("alpha", [249, 240, 204, 140])
def test_paint_of_any_opacity_is_found_and_labelled(alpha: int) -> None:
    picture = figure(alpha)
    found = extract_palette([picture])
    assert {one.rgb for one in found.colors} == {TEAL, RED}
    assert any("see-through" in text and "own colour counts" in text for text in found.warnings)
    labels = label_image(picture, found)
    assert (labels[45:68, 14:46] == [one.rgb for one in found.colors].index(TEAL)).all()


def test_opaque_drawings_stay_the_same_object() -> None:
    picture = figure(255)
    assert opaque_inside(picture) is picture
    assert not any("see-through" in text for text in extract_palette([picture]).warnings)


def test_brush_flow_counts_as_paint() -> None:
    flow = np.random.default_rng(0).integers(225, 256, (32, 44))
    assert {one.rgb for one in extract_palette([figure(flow)]).colors} == {TEAL, RED}


def test_a_few_such_pixels_are_left_by_matting() -> None:
    picture = figure(255)
    picture[30:32, 30:34, 3] = 200
    assert opaque_inside(picture) is picture
