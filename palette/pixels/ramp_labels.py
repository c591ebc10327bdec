"""Label the pixels of shaded drawings: the ramp that a colour lies on, alike among neighbours.

What a pixel costs as a paint is how far its colour lies off the paint's ramp and how far its
lightness lies from that paint's; labels that neighbours share cost less, and so does the paint
that the pixel's patch is of as a whole. Solved by mean-field
steps: every pixel's chances are pulled towards those around. Source: P. Kraehenbuehl and V. Koltun,
"Efficient inference in fully connected CRFs with Gaussian edge potentials" (2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from toonset.palette.colors import shaded_oklab_from_rgb
from toonset.palette.palette import Palette, PaletteColor
from toonset.palette.pixels.antialias import OPAQUE
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.patches import DARKEST, Lab, Numbers, Patches
from toonset.raster import is_uniform

HUE_SPREAD = 0.007  # in OKLab: of pixels off their ramp
LIGHT_SPREAD = 0.12  # lightness, at least, of a paint's pixels
WIDE, LOYAL = 0.5, np.float32(2.0)  # lightness of a paint's patches; what a pixel's patch weighs
OF_SPREAD = 2.0  # deviations from a ramp's middle to its ends
MOST = 12.0  # that a pixel costs: it may be what no paint is
TOGETHER, REACH_PX, STEPS = 3.0, 1.5, 4  # what neighbours weigh, how far, how often


@dataclass(frozen=True, eq=False)
class Ramp:
    """A paint's colours from dark to light, in `shaded_oklab_from_rgb`.

    Attributes:
        stops: at least one; lightness ascending.
        light: lightness in the middle of its pixels.
        spread: deviation of their lightness.
    """

    stops: Float[np.ndarray, "stops 3"]
    light: float
    spread: float

    def hue_at(self, light: Float32[np.ndarray, "*n"]) -> Float32[np.ndarray, "*n 2"]:
        """Return a and b at a lightness; beyond the stops on the ray through black."""
        stops, ends = self.stops, light.clip(self.stops[0, 0], self.stops[-1, 0])
        hue = np.stack([np.interp(ends, stops[:, 0], stops[:, n]) for n in (1, 2)], axis=-1)
        scale = light / np.maximum(ends, DARKEST)
        return np.asarray(hue * scale[..., None], dtype=np.float32)


def ramp_of(color: PaletteColor) -> Ramp:
    """Return a palette colour's ramp; of one without tones the ray through black."""
    if not color.tones:
        return plain_ramp(np.array(color.rgb, np.uint8))
    stops = shaded_oklab_from_rgb(np.array([tone.rgb for tone in color.tones], np.uint8))
    order = np.argsort(stops[:, 0], kind="stable")
    light = float(shaded_oklab_from_rgb(np.array(color.rgb, np.uint8))[0])
    spread = float(stops[order[-1], 0] - stops[order[0], 0]) / (2 * OF_SPREAD)
    return Ramp(stops[order], light, spread)


def plain_ramp(rgb: UInt8[np.ndarray, " 3"]) -> Ramp:
    """Return the ray through black of a colour of which no tones are known."""
    stop = shaded_oklab_from_rgb(rgb)
    return Ramp(stop[None], float(stop[0]), 0.0)


def ramps_of(palette: Palette) -> tuple[Ramp, ...]:
    """Return the ramps of a painted sheet's palette; none of any other."""
    return tuple(map(ramp_of, palette.colors)) if palette.has_ramps else ()


def ramp_labels(
    lab: Lab,
    opaque: Bool[np.ndarray, "height width"],
    parted: tuple[Numbers, Patches],
    ramps: Sequence[Ramp],
) -> tuple[UInt8[np.ndarray, "height width"], Float32[np.ndarray, "height width"]]:
    """Return every opaque pixel's ramp, 255 elsewhere, and how likely it is that one.

    Args:
        lab: see `toonset.palette.pixels.patches.smooth_lab`.
        opaque: where something is drawn.
        parted: its patches: see `toonset.palette.pixels.patches.find_patches`.
        ramps: 1 to 255.
    """
    numbers, patches = parted
    best = np.argmin([_squares(patches.mean, ramp, WIDE) for ramp in ramps], axis=0)
    whole = np.append(best, -1)[numbers]  # beyond the patches, numbers are -1
    cost = np.stack(
        [_cost(lab, ramp) - LOYAL * (whole == number) for number, ramp in enumerate(ramps)]
    )
    chance = _chances(cost, opaque)
    for _ in range(STEPS):
        around = np.stack([cv2.GaussianBlur(one, (0, 0), REACH_PX) for one in chance])
        chance = _chances(cost - np.float32(TOGETHER) * around, opaque)
    labels = chance.argmax(axis=0).astype(np.uint8)
    labels[~opaque] = UNLABELLED
    return labels, chance.max(axis=0)


def savings(
    lab: Lab, labels: UInt8[np.ndarray, "height width"], ramps: Sequence[Ramp]
) -> Float[np.ndarray, " ramps"]:
    """Return what the pixels of every ramp would cost more, in nats, if it were not there.

    Of a single ramp that is infinite.
    """
    if len(ramps) < 2:
        return np.full(len(ramps), np.inf)
    there = labels != UNLABELLED
    own, cost = labels[there], np.stack([_cost(lab[there], ramp) for ramp in ramps], axis=1)
    row = np.arange(len(own))
    spent = cost[row, own]
    cost[row, own] = np.inf
    return np.bincount(own, cost.min(axis=1) - spent, len(ramps))


def enlarged_labels(
    small: UInt8[np.ndarray, "small_height small_width"],
    picture: UInt8[np.ndarray, "height width 4"],
    ramps: Sequence[Ramp],
) -> UInt8[np.ndarray, "height width"]:
    """Return labels of a shrunk drawing at the drawing's own size, borders drawn by its pixels.

    Along borders a pixel gets the ramp among those around that its own colour lies on.
    """
    opaque = picture[..., 3] >= OPAQUE
    if small.shape == opaque.shape:
        return small
    size = opaque.shape[::-1]
    labels = np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_NEAREST))
    sure = cv2.resize(is_uniform(small).view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    row, column = np.nonzero(opaque & ((sure == 0) | (labels == UNLABELLED)))
    if len(row):
        lab = shaded_oklab_from_rgb(picture[row, column, :3])
        costs = [
            _cost(lab, ramp) - 2 * TOGETHER * _around(small == number, size)[row, column]
            for number, ramp in enumerate(ramps)
        ]
        labels[row, column] = np.argmin(costs, axis=0)
    labels[~opaque] = UNLABELLED
    return labels


def _around(
    there: Bool[np.ndarray, "small_height small_width"], size: tuple[int, ...]
) -> Float32[np.ndarray, "height width"]:
    """Return how much of what is around has a label, enlarged."""
    share = cv2.GaussianBlur(there.astype(np.float32), (0, 0), REACH_PX)
    return np.asarray(cv2.resize(share, size, interpolation=cv2.INTER_LINEAR))


def _cost(lab: Float[np.ndarray, "*n 3"], ramp: Ramp) -> Float32[np.ndarray, "*n"]:
    """Return what colours cost as a paint."""
    spread = float(np.hypot(ramp.spread, LIGHT_SPREAD))
    rare = np.log(spread / LIGHT_SPREAD)
    return np.minimum(_squares(lab, ramp, spread) / 2 + rare, MOST).astype(np.float32)


def _squares(lab: Float[np.ndarray, "*n 3"], ramp: Ramp, spread: float) -> Float[np.ndarray, "*n"]:
    """Return how far colours lie off a ramp and its lightness, in squares of deviations."""
    off = (lab[..., 1:] - ramp.hue_at(lab[..., 0])) / HUE_SPREAD
    return np.asarray(np.square(off).sum(axis=-1) + np.square((lab[..., 0] - ramp.light) / spread))


def _chances(
    cost: Float32[np.ndarray, "ramps height width"], opaque: Bool[np.ndarray, "height width"]
) -> Float32[np.ndarray, "ramps height width"]:
    chance = np.exp(cost.min(axis=0) - cost)
    return np.asarray(chance / chance.sum(axis=0) * opaque, dtype=np.float32)
