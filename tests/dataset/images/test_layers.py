"""Layers that hold a figure each are said; line art over colours is not."""

import pytest

from toonset.dataset.images.layers import Layer, layers_line

SIZE = (300, 100)
PAPER = Layer("Background", (0, 0, 300, 100))
FRONT, BACK = Layer("front", (10, 5, 60, 90)), Layer("back", (110, 5, 60, 88))
CAPTION = Layer("title", (200, 5, 60, 10))
FOUND = [(12, 6, 50, 88), (112, 6, 50, 86)]


@pytest.mark.parametrize("layers", [[FRONT, BACK], [PAPER, BACK, CAPTION, FRONT]])
def test_names_stand_in_the_order_of_the_views(layers: list[Layer]) -> None:
    line = layers_line(layers, SIZE, FOUND)
    assert line is not None
    assert "--views 'front,back'" in line


def test_other_numbers_are_said() -> None:
    line = layers_line([FRONT, BACK], SIZE, [(12, 6, 160, 88)])
    assert line is not None
    assert "2 of its layers hold a figure each, 1 views were found" in line


@pytest.mark.parametrize(
    "layers",
    [
        [],
        [PAPER, FRONT],
        [Layer("lines", (10, 5, 160, 90)), Layer("colour", (12, 6, 158, 88))],
        [FRONT, CAPTION, Layer("prop", (200, 50, 30, 40))],
    ],
)
def test_layers_that_are_no_figures_say_nothing(layers: list[Layer]) -> None:
    assert layers_line(layers, SIZE, FOUND) is None
