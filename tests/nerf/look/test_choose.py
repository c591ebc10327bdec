"""Seams between drawings go where both are alike, and what floats off a figure goes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from toonset.nerf.look.choose import Look, choose, shared_groups
from toonset.nerf.look.view_lines import _afloat

SIZE = 120
Y, X = (axis.astype(np.float32) for axis in np.mgrid[:SIZE, :SIZE])
INSIDE = np.ones((SIZE, SIZE), bool)


def look_at(paint: np.ndarray, share: float, afloat: np.ndarray = ~INSIDE) -> Look:
    """Return a view that sees all of a drawing, straight on."""
    far = np.full(INSIDE.shape, 50.0, np.float32)
    drawn = (paint * 255).astype(np.uint8)
    texture = SimpleNamespace(paint=paint, in_own=drawn, to_edge=far, afloat=afloat)
    return Look(texture, X, Y, INSIDE, share, 1.0)  # type: ignore[arg-type]


def test_a_seam_goes_round_what_only_one_drawing_has() -> None:
    plain = np.full((*INSIDE.shape, 3), 0.6, np.float32)
    arm = plain.copy()
    arm[50:70, 52:76] = (0.9, 0.1, 0.1)
    slope = np.float32(0.5) + ((X - 60) / 120).clip(-0.45, 0.45)
    looks = [look_at(arm, 0.5), look_at(plain, 0.5)]
    looks = [
        Look(look.texture, look.x, look.y, look.seen, share, 1.0)  # type: ignore[arg-type]
        for look, share in zip(looks, (1 - slope, slope), strict=True)
    ]
    chosen, _ = choose(looks, INSIDE, float(SIZE))
    assert {0, 1} == set(np.unique(chosen))
    assert len(set(np.unique(chosen[50:70, 52:76]))) == 1
    assert (chosen[:, :20] == 0).all()
    assert (chosen[:, -20:] == 1).all()


def test_a_hand_that_floats_goes_unless_a_drawing_shows_it_so() -> None:
    solid = np.zeros(INSIDE.shape, bool)
    solid[10:110, 10:60] = solid[20:40, 80:100] = True
    hand = solid & (X >= 80)
    paint = np.zeros((*INSIDE.shape, 3), np.float32)
    off = _afloat(solid, [look_at(paint, 1.0)])
    assert off[hand].all()
    assert not off[solid & ~hand].any()
    assert not _afloat(solid, [look_at(paint, 0.5), look_at(paint, 0.5, hand)]).any()


def test_legs_that_a_gap_parts_from_the_body_stay() -> None:
    solid = np.zeros(INSIDE.shape, bool)
    solid[10:70, 30:60] = solid[73:110, 35:45] = True
    paint = np.zeros((*INSIDE.shape, 3), np.float32)
    assert not _afloat(solid, [look_at(paint, 1.0)]).any()


def face_at(share: float, middle: int, stretched: float = 1.0) -> Look:
    """Return a view of a drawing with a face of 40 pixels round a column."""
    groups = (np.hypot(X - middle, Y - 60) < 20).astype(np.int16)
    paint = np.full((*INSIDE.shape, 3), 0.6, np.float32)
    paint[groups > 0] = (0.6, share, middle / SIZE)
    look = look_at(paint, share)
    features = SimpleNamespace(groups=groups)
    texture = SimpleNamespace(**vars(look.texture), features=features)
    x = (X - 60) / np.float32(stretched) + 60
    return Look(texture, x, Y, INSIDE, share, 1.0)  # type: ignore[arg-type]


def test_a_face_that_two_drawings_put_in_two_places_is_one_drawings() -> None:
    looks = [face_at(0.52, 54), face_at(0.48, 66)]
    (whole,) = shared_groups(looks)
    assert (whole.leader, whole.groups) == (0, ((1,), (1,)))
    both = (looks[0].group > 0) | (looks[1].group > 0)
    assert (whole.region(looks) == both).all()
    chosen, _ = choose(looks, INSIDE, float(SIZE), [whole])
    assert (chosen[both] == 0).all()


def test_the_face_that_is_stretched_less_leads() -> None:
    (whole,) = shared_groups([face_at(0.55, 60, stretched=2.0), face_at(0.45, 60)])
    assert whole.leader == 1


@pytest.mark.parametrize("middles", [(30, 90), (42, 78)])
def test_faces_apart_or_just_touching_are_nobodys_business(middles: tuple[int, int]) -> None:
    assert shared_groups([face_at(0.5, middle) for middle in middles]) == []
