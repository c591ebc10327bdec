"""Count the views that keep the right number of whole eyes.

An eye is a place of the character. What it looks like is measured on the truth: the colour at its
place, and round about it, as views from the front show them. A pixel is the eye's that is nearer to
the first. An eye that the truth shows as one closed patch must be there in the rendering: one
patch, half to twice as large, up to 2 % of the figure's height away. Nowhere else on the face may
the rendering have a patch like an eye where the truth has nothing so coloured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import mask_of
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.mesh import Mesh
from toonset.view import over_white

EYES_FILE = "eyes.json"
MARKS = Path(__file__).with_name(EYES_FILE)
PARTS = ("left eye", "right eye")
FRONT, SEEN = 0.7, -0.2  # cosine of the view to the front: looks like itself; may be seen
CORE, RING = 0.75, (1.5, 2.2)  # of the radius: where an eye's colour is measured, and that around
NEAR = 0.35  # of the distance of both colours: as near to an eye's is the eye's
REACH = 1.4  # of the radius: as far as an eye reaches
OFF = 0.02  # of the figure's height: hands are off by so much
WHOLE, SLIVER = 0.5, 0.15  # of its area at the front, an eye counts; less of it is none
CLOSED = 0.6  # of a patch lies within reach, or the eye runs into what is dark beside it
ALIKE = (0.5, 2.0)  # area over the truth's
ONE = 0.75  # of an eye is its largest patch
EXTRA, FACE = 0.4, 3.5  # of an eye's area: a patch that counts; radii round eyes that are face
THIN = 0.35  # of the radius: half as wide as lines are, beside which an eye stands by itself

Mask = Bool[np.ndarray, "height width"]
Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Eye:
    """An eye: its middle on the surface, and its radius, in world units."""

    center: Float[np.ndarray, " 3"]
    radius: float


@dataclass(frozen=True, eq=False)
class EyeLook:
    """What a character's eyes look like.

    Attributes:
        eyes: of the character.
        colors: (eyes, 2, 3) colour of each, and of what is round about it.
        areas: of each at the front, squared radii.
    """

    eyes: tuple[Eye, ...]
    colors: Float[np.ndarray, "eyes 2 3"]
    areas: Float[np.ndarray, " eyes"]


@dataclass(frozen=True)
class EyeCheck:
    """What became of the eyes in one view.

    Attributes:
        expected: eyes that the truth shows whole.
        faults: what is wrong, a word per fault: "missing", "split", "small", "large", "extra".
    """

    expected: int
    faults: tuple[str, ...]


def read_eyes(path: Path) -> tuple[Eye, ...]:
    """Return the eyes of a case folder's file; none where there is no file.

    The file is {"eyes": [{"center": [x, y, z], "radius": r}, ...]}, world units.

    Raises:
        BundleError: it holds something else.
    """
    return _eyes(read_json(path), path) if path.is_file() else ()


def marked_eyes(character: str) -> tuple[Eye, ...]:
    """Return the eyes of a character of the public cases, marked by hand; none of another."""
    known = read_json(MARKS)
    return _eyes(known[character], MARKS) if character in known else ()


def _eyes(entries: Any, path: Path) -> tuple[Eye, ...]:
    try:
        return tuple(_eye(entry) for entry in entries["eyes"])
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError(
            f'{path}: no list "eyes" of {{"center": [x, y, z], "radius": r}}; correct it'
        ) from error


def _eye(entry: Any) -> Eye:
    center, radius = np.array(entry["center"], dtype=float), float(entry["radius"])
    if center.shape != (3,) or not np.isfinite(center).all() or not 0 < radius < np.inf:
        raise ValueError("no place")
    return Eye(center, radius)


def eyes_of_body(body: Mesh) -> tuple[Eye, ...]:
    """Return the eyes of a body of `bench.stability.bodies.with_eyes`."""
    assert body.face_parts is not None
    found = []
    for number, name in enumerate(body.part_names):
        if name in PARTS:
            points = body.vertices[np.unique(body.faces[body.face_parts == number])]
            middle = (points.max(axis=0) + points.min(axis=0)) / 2
            found.append(Eye(middle, float(np.ptp(points[:, 0])) / 2))
    return tuple(found)


def eye_look(eyes: Sequence[Eye], truth: Scene) -> EyeLook | None:
    """Return what the eyes look like in true views; None where no view is from the front."""
    front = [frame for frame in truth.frames if _facing(frame.camera) > FRONT]
    if not front or not eyes:
        return None
    colors, areas = [], []
    for eye in eyes:
        pairs = [_colors_at(frame, eye) for frame in front]
        clear = np.argsort([-np.linalg.norm(own - around) for own, around in pairs])
        best = clear[: -(-len(front) // 2)]  # elsewhere it is hidden, or seen from its side
        pair = np.median([pairs[i] for i in best], axis=0)
        sizes = [
            _in_reach(_eye_mask(front[i].rgba, pair), front[i].camera, eye).sum() for i in best
        ]
        px = [eye.radius * front[i].camera.scale for i in best]
        colors.append(pair)
        areas.append(float(np.median(np.array(sizes) / np.square(px))))
    return EyeLook(tuple(eyes), np.stack(colors), np.array(areas))


def check_eyes(look: EyeLook, truth: Frame, rendered: Picture) -> EyeCheck:
    """Return what became of the eyes in a rendering of a true view."""
    camera, off = truth.camera, _off_px(truth)
    if _facing(camera) < SEEN:
        return EyeCheck(0, ())
    expected, faults = 0, []
    shape = truth.rgba.shape[:2]
    face, known, seen = (np.zeros(shape, dtype=bool) for _ in range(3))
    least = np.inf
    for eye, colors, area in zip(look.eyes, look.colors, look.areas, strict=True):
        radius = eye.radius * camera.scale
        own, found = _eye_mask(truth.rgba, colors), _eye_mask(rendered, colors)
        blobs = _opened(own, THIN * radius)
        face |= _disc(shape, _pixel(camera, eye), FACE * radius)
        known |= blobs
        seen |= _opened(found, THIN * radius)
        least = min(least, area * radius**2)
        patch, whole = _in_reach(own, camera, eye), _in_reach(blobs, camera, eye)
        if not (_is_whole(blobs, whole, area * radius**2) and _is_one(patch)):
            continue
        expected += 1
        window = _best_window(patch, found, camera, eye, off)
        known |= window
        fault = _fault(patch, found & window)
        faults += [fault] if fault else []
    extra = seen & face & ~_grown(known, off)
    faults += ["extra"] * _patches(extra, EXTRA * least)
    return EyeCheck(expected, tuple(faults) if expected else ())


def _fault(wanted: Mask, found: Mask) -> str:
    ratio = found.sum() / wanted.sum()
    if ratio < ALIKE[0]:
        return "small" if ratio > SLIVER else "missing"
    if ratio > ALIKE[1]:
        return "large"
    return "" if _is_one(found) else "split"


def _is_one(mask: Mask) -> bool:
    """Return whether nearly all of a mask is one patch."""
    _, _, about, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return bool(about[1:, cv2.CC_STAT_AREA].max(initial=0) >= max(ONE * mask.sum(), 1))


def _is_whole(own: Mask, patch: Mask, full: float) -> bool:
    """Return whether the truth shows an eye whole, and apart from what is as dark beside it."""
    if patch.sum() < max(WHOLE * full, 1):
        return False
    _, part = cv2.connectedComponents(own.astype(np.uint8), connectivity=8)
    touched = np.isin(part, np.unique(part[patch]))
    return bool(patch.sum() >= CLOSED * touched.sum())


def _best_window(patch: Mask, found: Mask, camera: Camera, eye: Eye, off: float) -> Mask:
    """Return the reach of an eye, moved to where the rendering is most like the truth's."""
    most, best = -1.0, (0, 0)
    reach = round(off)
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            moved = np.roll(patch, (y, x), (0, 1))
            both = float((moved & found).sum()) - 1e-3 * (x * x + y * y)
            if both > most:
                most, best = both, (y, x)
    at = _pixel(camera, eye) + np.array([best[1], best[0]])
    return _disc(patch.shape, at, REACH * eye.radius * camera.scale + 1)


def _facing(camera: Camera) -> float:
    """Return the cosine between the way to the viewer and the character's front."""
    return float(-camera.rotation[2, 2])


def _off_px(truth: Frame) -> float:
    rows = np.flatnonzero(mask_of(truth.rgba).any(axis=1))
    return max(1.0, OFF * (rows[-1] - rows[0] + 1)) if len(rows) else 1.0


def _pixel(camera: Camera, eye: Eye) -> Float[np.ndarray, " 2"]:
    return camera.project(eye.center[None])[0][0] - 0.5


def _disc(shape: tuple[int, ...], at: Float[np.ndarray, " 2"], radius: float) -> Mask:
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    inside: Mask = (columns - at[0]) ** 2 + (rows - at[1]) ** 2 <= radius**2
    return inside


def _in_reach(mask: Mask, camera: Camera, eye: Eye) -> Mask:
    return mask & _disc(mask.shape, _pixel(camera, eye), REACH * eye.radius * camera.scale + 1)


def _colors_at(frame: Frame, eye: Eye) -> Float[np.ndarray, "2 3"]:
    picture, at = over_white(frame.rgba), _pixel(frame.camera, eye)
    radius, shape = eye.radius * frame.camera.scale, frame.rgba.shape[:2]
    core = _disc(shape, at, max(CORE * radius, 1))
    low, high = (_disc(shape, at, share * radius) for share in RING)
    return np.stack([np.median(picture[part], axis=0) for part in (core, high & ~low)])


def _eye_mask(rgba: Picture, colors: Float[np.ndarray, "2 3"]) -> Mask:
    apart = np.linalg.norm(colors[0] - colors[1])
    near: Mask = np.linalg.norm(over_white(rgba) - colors[0], axis=-1) < NEAR * apart
    return near & mask_of(rgba)


def _opened(mask: Mask, radius: float) -> Mask:
    """Return a mask without what is thinner than twice the radius."""
    side = 2 * round(radius) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0


def _grown(mask: Mask, radius: float) -> Mask:
    side = 2 * round(radius) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.dilate(mask.astype(np.uint8), disc) > 0


def _patches(mask: Mask, least: float) -> int:
    """Return how many patches of a mask are so large."""
    _, _, about, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return int((about[1:, cv2.CC_STAT_AREA] >= max(least, 1)).sum())
