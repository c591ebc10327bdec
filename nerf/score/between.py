"""Measure what eyes see on a view between drawings, beside the drawings themselves.

Nothing here needs the truth: a view that is as whole as the drawings beside it has outlines and
borders of paint that turn about as much as theirs, no patches that neither of them shows, and the
features that both show. Whether they can be put together at all is told by painting the view from
either of them alone: A and B, where both see the surface, in CIELAB and a little blurred,

    apart = sum |A - B| / sum |view moved by a pixel - view| / height in pixels
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.look.asked import flanking
from toonset.nerf.look.blend import blend_view
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import GUESSED, MIRRORED, SOLID
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.layers import Rendering
from toonset.nerf.render.turntable import between_drawings
from toonset.nerf.render.views import render
from toonset.nerf.score.left_out import TALL_PX, by_pixel, difference
from toonset.nerf.score.outline_turning import border_turning, outline_turning
from toonset.nerf.score.patches import (
    Patches,
    features,
    fragments,
    matched,
    patches_of,
    plain_colors,
)

VIEWS, REPORTED_PX = 4, 120.0  # of a report, as many as a preview shows; px of the figure
Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Seen:
    """What eyes count on one picture.

    Attributes:
        outline: whole turns of the silhouette's outlines (`outline_turning`).
        borders: whole turns of the borders of paints.
        patches: small areas of one paint.
    """

    outline: float
    borders: float
    patches: Patches


@dataclass(frozen=True)
class BetweenView:
    """A view between two drawings, and what is wrong with it.

    Attributes:
        yaw: of the view, radians.
        beside: yaws of the two drawings that it lies between, radians; twice that of one that it
            lies beside.
        outline: turns of its outlines.
        own_outline: of the two drawings', mean.
        borders: turns of its borders of paint.
        own_borders: of the two drawings', mean.
        fragments: small patches that neither of the two drawings has.
        features: small patches that both have.
        whole: as many of them the view has.
        apart: how far apart both paint the view, share of the figure's height; 0 of one drawing.
        mirrored: share of its pixels that only the mirror image of a drawing shows.
        guessed: share that no drawing shows.
    """

    yaw: float
    beside: tuple[float, float]
    outline: float
    own_outline: float
    borders: float
    own_borders: float
    fragments: int
    features: int
    whole: int
    apart: float
    mirrored: float
    guessed: float


class Between:
    """Judge views between drawings, at one size of the figure."""

    def __init__(self, drawings: Drawings, tall_px: float) -> None:
        """Take the drawings, and how tall the figure is in the pictures to judge, pixels."""
        self._drawings, self._tall_px = drawings, tall_px

    @cached_property
    def pictures(self) -> tuple[Picture, ...]:
        """Return the drawings, mirrored ones included, as they are drawn, at that size."""
        unit = self._tall_px / self._drawings.height
        views = (view.as_drawn for view in self._drawings.views)
        return tuple(_resized(own.rgba, unit / own.camera.scale) for own in views)

    @cached_property
    def paints(self) -> UInt8[np.ndarray, "paints 3"]:
        """Return the colours that eyes tell apart on the drawings."""
        return plain_colors(self.pictures)

    @cached_property
    def drawn(self) -> tuple[Seen, ...]:
        """Return what eyes count on the drawings."""
        return tuple(self.seen(picture) for picture in self.pictures)

    def seen(self, rgba: Picture) -> Seen:
        """Return what eyes count on a picture whose figure is as tall as was said."""
        alpha = rgba[..., 3] / np.float32(255)
        paints = self.paints
        return Seen(
            outline_turning(alpha, self._tall_px),
            border_turning(rgba, paints, self._tall_px),
            patches_of(rgba, paints, self._tall_px),
        )

    def judged(self, view: Rendering, rgba: Picture | None = None) -> BetweenView:
        """Return what is wrong with a view.

        Args:
            view: of a field with these drawings, the figure as tall as was said.
            rgba: another picture of the same camera; None: the view in the drawn look.
        """
        cameras = [own.camera for own in self._drawings.views]
        first, second, _ = flanking(cameras, view.camera)
        own = self.seen(view.picture("drawn") if rgba is None else rgba)
        pair = self.drawn[first], self.drawn[second]
        common = features(pair[0].patches, pair[1].patches)
        drawn = view.drawn
        return BetweenView(
            view.camera.angles[0],
            (cameras[first].angles[0], cameras[second].angles[0]),
            own.outline,
            (pair[0].outline + pair[1].outline) / 2,
            own.borders,
            (pair[0].borders + pair[1].borders) / 2,
            fragments(own.patches, [one.patches for one in pair]),
            len(common),
            matched(common, own.patches),
            _apart(self._drawings, view, (first, second), self._tall_px),
            drawn.share(MIRRORED),
            drawn.share(GUESSED),
        )


def views_between(baked: Baked, count: int = VIEWS) -> tuple[BetweenView, ...]:
    """Return what is wrong with views half way between drawings, the figure REPORTED_PX tall.

    Args:
        baked: a field; empty where it has no drawings.
        count: number of views, yaw rising.
    """
    drawings = baked.trained.drawings
    if drawings is None:
        return ()
    judge = Between(drawings, REPORTED_PX)
    assert judge.drawn  # made here: two threads must not make them twice

    def one(camera: Camera) -> BetweenView:
        small = camera.resized(REPORTED_PX / (drawings.height * camera.scale))
        return judge.judged(render(baked, small))

    cameras = between_drawings(baked.trained, count)
    return tuple(side_by_side([partial(one, camera) for camera in cameras]))


def _apart(drawings: Drawings, view: Rendering, beside: tuple[int, int], tall_px: float) -> float:
    """Return how far apart two drawings paint a view, where both see it, over the height."""
    if beside[0] == beside[1]:
        return 0.0
    fitting = drawings.fitting(view.camera.scale)
    seen = np.ones(view.drawn.alpha.shape, dtype=bool)
    pictures = []
    for number in beside:
        found = blend_view(_alone(fitting, number), view.geometry)
        seen &= (found.source != GUESSED) & (found.alpha >= SOLID)
        pictures.append(found.paint)
    half = TALL_PX / tall_px
    first, second, whole = (_shrunk(one, half) for one in (*pictures, view.drawn.rgb))
    both = _shrunk(seen.astype(np.float32), half) >= SOLID
    moved = by_pixel(whole + 1 - _shrunk(view.drawn.alpha, half)[..., None])
    return float((difference(first, second) * both).sum()) / max(moved, 1e-9) / TALL_PX


def _alone(drawings: Drawings, number: int) -> Drawings:
    """Return one of the drawings."""
    for other in range(len(drawings.views) - 1, -1, -1):
        drawings = drawings if other == number else drawings.without(other)
    return drawings


def _shrunk(values: np.ndarray, factor: float) -> np.ndarray:
    size = tuple(max(1, round(side * factor)) for side in values.shape[1::-1])
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(values, np.float32), size, interpolation=how))


def _resized(rgba: Picture, factor: float) -> Picture:
    """Return a picture of another size, averaged with its coverage."""
    size = tuple(max(1, round(side * factor)) for side in rgba.shape[1::-1])
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    alpha = rgba[..., 3:] / np.float32(255)
    whole = cv2.resize(np.dstack([rgba[..., :3] * alpha, alpha]), size, interpolation=how)
    cover = whole[..., 3:].clip(0, 1)
    color = (whole[..., :3] / np.maximum(cover, 1e-6)).clip(0, 255)
    return np.rint(np.dstack([color, cover * 255])).astype(np.uint8)
