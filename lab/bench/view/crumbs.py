"""Count what recolouring on the page leaves of an old colour, in the pictures that it saves.

Every paint in turn is given a colour that nothing on the figure has. Counted are pixels that still
have the old one, and pixels outside the hull of the paints around (TOLERANCE levels more than
before): a rim that shines. What lies near a colour that no paint has is not judged.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from PIL import Image
from playwright.sync_api import Page
from scipy.optimize import nnls

from toonset.palette.colors import oklab_from_rgb

NEW = ((40, 220, 60), (204, 34, 102), (60, 90, 250), (250, 230, 40), (40, 220, 230), (230, 60, 230))
LIKE = 10.0  # levels of 255: such a pixel shows a paint
OLD = 40.0  # levels: what is no farther from the old colour has kept it
AROUND = 4  # pixels of a saved picture at its first size: paints in it may be in a mixture
FAR = 3  # times as far the paint that is recoloured may be
TOLERANCE = 24.0  # levels: sRGB pictures that were lossy may stray
UNKNOWN = 30.0  # levels: so far from all paints' mixtures is none of them
LEAST_ALPHA = 32

Picture = UInt8[np.ndarray, "height width 4"]
Mask = Bool[np.ndarray, "height width"]
Bits = Int[np.ndarray, "*at"]  # of paints
Colors = Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Left:
    """What one recolouring left, in pixels.

    Attributes:
        paint: its name.
        factor: the saved picture's size.
        judged: pixels.
        old: those that kept the old colour.
        shining: those outside of the paints' hull.
    """

    paint: str
    factor: int
    judged: int
    old: int
    shining: int


def left_behind(page: Page, yaws: Sequence[float], factors: Sequence[int]) -> Iterator[Left]:
    """Recolour every paint of an open page in turn, save pictures and count.

    Args:
        page: of `toonset view`, in the drawn look, that may download.
        yaws: views to look at, degrees.
        factors: sizes to save.
    """
    scene = page.evaluate("({ palette: toonset.scene.palette, pen: toonset.scene.pen })")
    old = [paint["rgb"] for paint in scene["palette"]]
    paints = np.array([*old, *([scene["pen"]["rgb"]] if scene["pen"] else [])], float)
    for yaw in yaws:
        page.evaluate("yaw => toonset.store.set({ yaw })", yaw)
        for factor in factors:
            before = _saved(page, old, factor)
            around, farther = (_around(before, paints, far * factor) for far in (1, FAR))
            places = _Places.of(before, around, paints, factor)
            for number, paint in enumerate(scene["palette"]):
                new = _far_from(paints)
                now = [new if i == number else rgb for i, rgb in enumerate(old)]
                after = _saved(page, now, factor)
                changed = paints.copy()
                changed[number] = new
                own = around | (farther & 1 << number)
                yield places.left(before, after, own, changed, number, paint["name"], factor)
    page.evaluate("colors => toonset.store.set({ colors })", old)


def _saved(page: Page, colors: Sequence[Sequence[int]], factor: int) -> Picture:
    page.evaluate("colors => toonset.store.set({ colors })", colors)
    page.locator("#factor").select_option(str(factor))
    with page.expect_download() as download:
        page.locator("#save_png").click()
    data = Path(download.value.path()).read_bytes()
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))


def _far_from(paints: Colors) -> list[int]:
    """Return the colour of NEW that is least like any paint."""
    known = oklab_from_rgb(paints.astype(np.uint8))
    apart = [
        np.linalg.norm(known - one, axis=1).min() for one in oklab_from_rgb(np.array(NEW, np.uint8))
    ]
    return list(NEW[int(np.argmax(apart))])


def _around(picture: Picture, paints: Colors, factor: int) -> Bits:
    """Return for every pixel a bit per paint that shows around; the last one is anywhere."""
    reach = _square(AROUND * factor)
    found = np.zeros(picture.shape[:2], np.int64)
    opaque = picture[..., 3] >= LEAST_ALPHA
    for number, paint in enumerate(paints):
        own = opaque & (np.linalg.norm(picture[..., :3] - paint, axis=-1) < LIKE)
        near = cv2.dilate(own.view(np.uint8), reach) > 0
        found |= np.where(near | (number == len(paints) - 1), 1 << number, 0)
    return found


@dataclass(frozen=True, eq=False)
class _Places:
    """The pixels that are judged, and how far each was from the hull of the paints around it."""

    at: Mask
    off: Float[np.ndarray, " n"]
    paints: Colors

    @classmethod
    def of(cls, picture: Picture, around: Bits, paints: Colors, factor: int) -> _Places:
        """Return the pixels of a picture that are judged."""
        there = picture[..., 3] >= LEAST_ALPHA
        off = np.zeros(there.shape)
        off[there] = _off_hulls(picture[there][:, :3].astype(float), around[there], paints)
        reach = _square(AROUND * factor)
        at = there & (cv2.dilate((off > UNKNOWN).view(np.uint8), reach) == 0)
        return cls(at, off[at], paints)

    def left(
        self,
        before: Picture,
        after: Picture,
        around: Bits,
        now: Colors,
        number: int,
        name: str,
        factor: int,
    ) -> Left:
        """Return what is left of a paint whose colour is another one now."""
        was, found = (one[self.at][:, :3].astype(float) for one in (before, after))
        own = np.linalg.norm(was - self.paints[number], axis=1) < LIKE
        seen = own | (was != found).any(axis=1)
        off = np.zeros(len(was))
        off[seen] = _off_hulls(found[seen], around[self.at][seen], now)
        same = np.linalg.norm(found - self.paints[number], axis=1) < OLD
        old = own & same & (off > TOLERANCE)
        shining = off > self.off + TOLERANCE
        return Left(name, factor, len(was), int(old.sum()), int(shining.sum()))


def _square(reach: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_RECT, (2 * reach + 1, 2 * reach + 1))


def _off_hulls(colors: Colors, around: Bits, paints: Colors) -> Float[np.ndarray, " n"]:
    """Return how far every colour is from the hull of the paints around it."""
    off = np.zeros(len(colors))
    for kind in np.unique(around).tolist():
        own = around == kind
        off[own] = _off_hull(colors[own], paints[[i for i in range(len(paints)) if kind >> i & 1]])
    return off


def _off_hull(colors: Colors, corners: Colors) -> Float[np.ndarray, " n"]:
    off = np.full(len(colors), np.inf)
    for i, one in enumerate(corners):
        for other in corners[: i + 1]:
            way = other - one
            share = ((colors - one) @ way / max(float(way @ way), 1e-9)).clip(0, 1)
            near = np.linalg.norm(colors - one - share[:, None] * way, axis=1)
            off = np.minimum(off, near)
    far = np.flatnonzero(off > TOLERANCE / 2)
    if len(corners) > 2 and len(far):
        system = np.vstack([corners.T, np.full(len(corners), 1e4)])  # shares that make up one
        kinds, place = np.unique(colors[far], axis=0, return_inverse=True)
        left = np.array([nnls(system, np.append(color, 1e4))[1] for color in kinds])
        off[far] = np.minimum(off[far], left[place.ravel()])
    return off
