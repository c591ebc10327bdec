"""Features of drawings are carried whole, once, and what is torn off goes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from toonset.camera import Camera
from toonset.nerf.look.choose import Look, Shared
from toonset.nerf.look.features import Features, features_of
from toonset.nerf.look.stamps import stamped, stamps, torn

HEIGHT = 200  # of the figure, and of the pictures
SKIN, BLACK = (0.9, 0.7, 0.5), (0.05, 0.05, 0.05)
CAMERA = Camera.looking_at(np.zeros(3), 0.0, 0.0, 1.0, (HEIGHT, HEIGHT))
FACE = np.zeros((HEIGHT, HEIGHT), bool)
FACE[5:-5, 5:-5] = True


def face(*eyes: tuple[int, int]) -> np.ndarray:
    """Return a face with eyes of 15 pixels at columns and rows."""
    picture = np.full((HEIGHT, HEIGHT, 3), SKIN, np.float32)
    for eye in eyes:
        cv2.circle(picture, eye, 7, BLACK, -1)
    return picture


def found_middles(found: Features) -> np.ndarray:
    """Return column and row of every feature."""
    return np.array([feature.middle for feature in found.found]).reshape(-1, 2)


def look_at(picture: np.ndarray, share: float, shift: np.ndarray | float = 0.0) -> Look:
    """Return a view of a drawing in which everything lies `shift` pixels further to the left."""
    y, x = (axis.astype(np.float32) for axis in np.mgrid[:HEIGHT, :HEIGHT])
    labels = (picture.mean(axis=2) < 0.4).astype(np.uint8)
    found = features_of(picture, labels, FACE, None, HEIGHT)
    aside = found_middles(found) + np.array([0.5 - np.mean(shift), 0.5])
    texture = SimpleNamespace(
        paint=picture,
        labels=labels,
        features=found,
        camera=CAMERA,
        figure_px=float(HEIGHT),
        anchors=CAMERA.unproject(aside, np.zeros(len(aside))),
    )
    seen = np.ones(FACE.shape, bool)
    return Look(texture, x + np.float32(shift), y, seen, share, 1.0)  # type: ignore[arg-type]


def shown(*looks: Look) -> np.ndarray:
    """Return the view that the first look's drawing gives, with the features of all."""
    chosen = np.zeros(FACE.shape, int)
    counts = np.stack([np.full(FACE.shape, look.share, np.float32) for look in looks])
    depth = np.zeros(FACE.shape, np.float32)
    placed, without = stamps(looks, len(looks) > 1, CAMERA, chosen, counts, depth, HEIGHT)
    bare = [look.bare(those) for look, those in zip(looks, without, strict=True)]
    color, label = stamped(bare[0].paint, bare[0].label, looks, placed, depth, 1.0)
    assert ((label == 1) != (color.mean(axis=2) < 0.375)).sum() <= 12  # of 47 at its border
    return color


def eyes_in(color: np.ndarray) -> list[tuple[float, float, int]]:
    """Return column, row and area of every dark blot."""
    _, _, boxes, middles = cv2.connectedComponentsWithStats(
        (color.mean(axis=2) < 0.4).astype(np.uint8)
    )
    return [
        (float(x), float(y), int(area))
        for (x, y), area in zip(middles[1:], boxes[1:, cv2.CC_STAT_AREA], strict=True)
    ]


def test_an_eye_on_a_torn_surface_is_whole() -> None:
    step = np.where(np.arange(HEIGHT) < 98, 0.0, 5.0)
    look = look_at(face((100, 80)), 1.0, step)
    torn_off = eyes_in(look.paint)
    (eye,) = eyes_in(shown(look))
    assert torn_off[0][2] < 130
    assert abs(eye[2] - 149) < 12
    assert abs(eye[1] - 80) < 1


def test_an_eye_that_two_drawings_put_in_two_places_is_shown_once_between_them() -> None:
    near, far = look_at(face((100, 80)), 0.75), look_at(face((100, 80)), 0.25, 8.0)
    (eye,) = eyes_in(shown(near, far))
    assert abs(eye[0] - 98) < 1


def test_two_eyes_stay_two() -> None:
    near, far = (
        look_at(face((70, 80), (130, 80)), 0.6),
        look_at(face((70, 80), (130, 80)), 0.4, 6.0),
    )
    assert sorted(round(eye[0]) for eye in eyes_in(shown(near, far))) == [68, 128]


def test_an_eye_that_two_drawings_put_far_apart_sideways_is_one_and_in_height_two() -> None:
    near, far = look_at(face((100, 80)), 0.6), look_at(face((100, 80)), 0.4, 20.0)
    (eye,) = eyes_in(shown(near, far))
    assert abs(eye[0] - 92) < 1
    lower = look_at(face((100, 95)), 0.4)
    assert [round(eye[1]) for eye in eyes_in(shown(near, lower))] == [80]


def test_a_large_round_eye_is_a_feature_and_of_a_belt_only_its_button() -> None:
    picture = np.full((HEIGHT, HEIGHT, 3), SKIN, np.float32)
    for column in (60, 140):
        cv2.circle(picture, (column, 80), 16, BLACK, -1)
        cv2.circle(picture, (column, 80), 14, (1, 1, 1), -1)
        cv2.circle(picture, (column + 3, 80), 4, BLACK, -1)
    found = features_of(picture, np.zeros(FACE.shape, np.uint8), FACE, (2.0, (13, 13, 13)), HEIGHT)
    assert sorted(round(one.middle[0]) for one in found.found) == [60, 140]
    assert all(one.area > 600 for one in found.found)
    belt = np.full((HEIGHT, HEIGHT, 3), SKIN, np.float32)
    cv2.rectangle(belt, (40, 80), (160, 88), (0.2, 0.3, 0.6), -1)
    cv2.circle(belt, (100, 84), 2, BLACK, -1)
    found = features_of(belt, np.zeros(FACE.shape, np.uint8), FACE, None, HEIGHT)
    assert [round(one.middle[0]) for one in found.found] == [100]


def test_what_only_the_other_drawing_has_is_not_added() -> None:
    assert eyes_in(shown(look_at(face(), 0.7), look_at(face((100, 80)), 0.3))) == []


def test_an_eye_seen_from_the_side_is_hidden() -> None:
    look = look_at(face((100, 80)), 1.0)
    x = (look.x - 100) * np.float32(6) + 100
    assert eyes_in(shown(replace(look, x=x))) == []


def test_a_hat_in_front_of_an_eye_hides_it() -> None:
    look = look_at(face((100, 80)), 1.0)
    chosen, counts = np.zeros(FACE.shape, int), np.ones((1, *FACE.shape), np.float32)
    depth = np.zeros(FACE.shape, np.float32)
    placed, without = stamps([look], False, CAMERA, chosen, counts, depth, HEIGHT)
    hat = np.broadcast_to(np.arange(HEIGHT)[:, None] < 80, FACE.shape)
    nearer = np.where(hat, -2.0, depth).astype(np.float32)
    bare = replace(look, seen=~hat).bare(without[0])
    color, _ = stamped(bare.paint, bare.label, [bare], placed, nearer, 1.0)
    (eye,) = eyes_in(color)
    assert eye[1] > 80


def test_an_eye_over_the_rim_is_moved_in_and_one_beside_the_figure_is_hidden() -> None:
    look = look_at(face((30, 80)), 1.0)
    counts, depth = np.ones((1, *FACE.shape), np.float32), np.zeros(FACE.shape, np.float32)
    for rim, middles in ((28, [35.0]), (40, [])):
        chosen = np.where(np.arange(HEIGHT) < rim, -1, 0) + np.zeros(FACE.shape, int)
        placed, _ = stamps([look], False, CAMERA, chosen, counts, depth, HEIGHT)
        assert [stamp.middle[0] for stamp in placed] == pytest.approx(middles, abs=1.5)


def test_blots_that_no_drawing_has_are_torn_and_freckles_are_not() -> None:
    drawing = face((100, 80))
    drawing[130:133, 60:63] = BLACK
    look = look_at(drawing, 1.0)
    view = drawing.copy()
    view[150:154, 120:128] = BLACK
    view[170:174, 90:98] = (0.6, 0.4, 0.3)
    off = torn(view, [look], np.zeros(FACE.shape, int), FACE, HEIGHT, None)
    assert off[150:154, 120:128].all()
    assert off[170:174, 90:98].all()
    assert not off[:145].any()
    inky = torn(view, [look], np.zeros(FACE.shape, int), FACE, HEIGHT, (2.0, (0, 0, 0)))
    assert inky[150:154, 120:128].all()  # a patch of paint is no line that is astray
    assert not inky[160:].any()


def test_a_face_without_features_is_left_as_it_is() -> None:
    found = features_of(face(), np.zeros(FACE.shape, np.uint8), FACE, (2.0, (0, 0, 0)), HEIGHT)
    assert found.found == ()
    assert np.array_equal(found.paint, face())


def test_the_features_of_a_face_are_one_group_and_a_button_is_another() -> None:
    picture = face((80, 50), (110, 50), (95, 160))
    found = features_of(picture, np.zeros(FACE.shape, np.uint8), FACE, None, HEIGHT)
    groups = found.groups
    assert (
        groups[50, 80] == groups[50, 110] == groups[50, 95] > 0
    )  # what lies between belongs to it
    assert groups[160, 95] not in {0, groups[50, 80]}
    assert groups[105, 95] == 0
    assert len(set(found.group_of)) == 2


def test_a_face_that_one_drawing_shows_keeps_its_own_places_and_loses_the_others() -> None:
    own, its = face((75, 60), (105, 60)), face((85, 60), (115, 60))
    looks = [look_at(own, 0.6), look_at(its, 0.4)]
    whole = Shared(0, ((1,), (1,)))
    chosen = np.zeros(FACE.shape, int)
    counts = np.stack([np.full(FACE.shape, look.share, np.float32) for look in looks])
    depth = np.zeros(FACE.shape, np.float32)
    placed, without = stamps(looks, True, CAMERA, chosen, counts, depth, HEIGHT, [whole])
    middles = sorted(stamp.middle[0] for stamp in placed)
    assert middles == pytest.approx([75, 105], abs=0.6)
    assert {stamp.drawing for stamp in placed} == {0}
    assert without[1][1:].all()


def test_no_group_is_larger_than_a_face() -> None:
    picture = face(*((x, 60) for x in range(20, 190, 22)))
    found = features_of(picture, np.zeros(FACE.shape, np.uint8), FACE, None, HEIGHT)
    sizes = [np.ptp(np.argwhere(found.groups == n), axis=0).max() for n in set(found.group_of)]
    assert len(sizes) > 1
    assert max(sizes) < (0.35 + 2 * 0.015) * HEIGHT + 2


def test_features_on_two_paints_are_two_groups() -> None:
    picture = face((80, 50), (80, 80))
    picture[65:] = (0.2, 0.4, 0.9)
    cv2.circle(picture, (80, 80), 7, BLACK, -1)
    found = features_of(picture, np.zeros(FACE.shape, np.uint8), FACE, None, HEIGHT)
    assert len(set(found.group_of)) == len(found.found) == 2
