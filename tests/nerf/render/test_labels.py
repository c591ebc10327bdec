"""Palette labels of renderings: crisp, without a third colour between two."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from toonset.nerf.render.labels import LEVELS, NONE, label_table, labels_of, palette_shares

GREEN, BROWN, SKIN = PAINTS = torch.tensor(
    [[0.0, 0.55, 0.34], [0.6, 0.55, 0.4], [0.96, 0.72, 0.58]]
)
SIDE = 12


class Nearest(nn.Module):
    """A classifier that answers with the nearest of the paints."""

    def forward(self, rgb: Tensor) -> Tensor:
        return -torch.cdist(rgb, PAINTS)


TABLE = label_table(Nearest())  # type: ignore[arg-type]


def test_a_table_gives_the_classifiers_labels_but_next_to_its_borders() -> None:
    color = torch.rand(3, 500, generator=torch.Generator().manual_seed(0))
    opacity = torch.linspace(0.1, 1, 500)
    found = labels_of(TABLE, color * opacity, opacity)
    away = torch.cdist(color.T, PAINTS).sort(dim=1).values
    sure = away[:, 1] - away[:, 0] > 2 * math.sqrt(3) / LEVELS
    assert sure.sum() > 400
    assert (found == Nearest()(color.T).argmax(dim=1))[sure].all()


def picture(left: Tensor, right: Tensor, blend: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return rays of two paints side by side, with a column between whose rays see a blend."""
    seen = torch.zeros(SIDE, SIDE, 5)
    seen[:, :6, :3], seen[:, 6:, :3], seen[..., 3] = left, right, 1.0
    seen[:, 6, :3] = blend
    border = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    border[:, 6] = True
    return seen, border, seen[border][:, None].repeat(1, 4, 1)


def shares(seen: Tensor, border: Tensor, more: Tensor, paints: Tensor = PAINTS) -> np.ndarray:
    rays, opacity = more.permute(2, 0, 1), seen[..., 3]
    return palette_shares(TABLE, paints, opacity, labelled(seen), border, rays).numpy()


def labelled(seen: Tensor) -> Tensor:
    return labels_of(TABLE, seen[..., :3].movedim(-1, 0), seen[..., 3])


@pytest.mark.parametrize("part", [0.3, 0.5, 0.8])
def test_a_blend_of_two_paints_is_no_third(part: float) -> None:
    blend = GREEN + part * (SKIN - GREEN)
    seen, border, more = picture(GREEN, SKIN, blend)
    found = shares(seen, border, more)
    assert found[..., 1].max() == 0
    steep = min(max((part - 0.5) * 2 + 0.5, 0), 1)
    np.testing.assert_allclose(found[:, 6], np.tile([1 - steep, 0, steep], (SIDE, 1)), atol=1e-5)
    np.testing.assert_allclose(found.sum(axis=2), 1, atol=1e-5)


def test_a_thin_line_of_a_third_paint_stays() -> None:
    seen, border, more = picture(GREEN, SKIN, BROWN + 0.01)
    assert (shares(seen, border, more)[:, 6, 1] == 1).all()


def test_a_paint_that_the_figure_shows_nowhere_is_a_blend() -> None:
    paints = PAINTS.clone()
    paints[1] = torch.nan
    seen, border, more = picture(GREEN, SKIN, BROWN)
    assert shares(seen, border, more, paints)[..., 1].max() == 0


def test_shares_keep_opacity_and_nothing_has_no_label() -> None:
    seen, border, more = picture(GREEN, SKIN, (GREEN + SKIN) / 2)
    seen[:3], more[:3] = 0, 0
    more[3:, :2] *= 0.5
    found = shares(seen, border, more)
    assert not found[:3].any()
    np.testing.assert_allclose(found[3:, 6].sum(axis=1), 0.75, atol=1e-5)
    labels = labelled(seen)
    assert (labels[:3] == NONE).all()
    assert (labels[3:] != NONE).all()
