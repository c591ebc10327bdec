"""Learn where the light of a two-tone shadow stands, to cast the shadow anew.

    shadow where  slope . n + level > 0,     colour in shadow = factor * colour in light

n is the surface's normal in camera axes, a little smoothed. The factor and the drawings' tones are
the palette's (`toonset.palette.pixels.shadow`); logistic regression on the normals beside the
shadow's borders says where the light stands. The shadow can be cast anew if the light that all
other drawings show tells a drawing's sides apart.

Source: toon shading by a threshold on the normal, Lake et al. 2000.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.json_file import Number, Share
from toonset.palette.pixels.shadow import border_votes, find_shadow, find_tones
from toonset.raster import dilate, nearest

ACCURATE = 0.68  # of a left-out drawing's sides must be told
RIDGE, NEWTON = 1e-4, 12
MIXED_PX, MIXED = 2, 0.06  # beside a border between tones; colours off a mixture of both
SOFT = 0.012  # of the figure's height: sigma by which normals are smoothed

Paint = UInt8[np.ndarray, "height width 3"]
Normals = Float[np.ndarray, "height width 3"]
Mask = Bool[np.ndarray, "height width"]


@dataclass(frozen=True)
class Shade:
    """A shadow; see the module's equation.

    Attributes:
        slope: of the normal, in camera axes.
        level: of a surface without slope.
        factor: red, green and blue in shadow over those in light.
    """

    slope: tuple[Number, Number, Number]
    level: Number
    factor: tuple[Share, Share, Share]

    def logit(self, normal: Normals) -> Float[np.ndarray, "height width"]:
        """Return the logarithm of how much likelier shadow is than light."""
        return np.asarray(normal @ np.array(self.slope, np.float32) + np.float32(self.level))

    def tone(self, normal: Normals, finer: int) -> Float[np.ndarray, "height width 3"]:
        """Return the factor of a view's colours in light; borders lie between pixels.

        Args:
            normal: `smoothed`.
            finer: samples per pixel and axis.
        """
        height, width = normal.shape[:2]
        size = (finer * width, finer * height)
        close = cv2.resize(self.logit(normal), size, interpolation=cv2.INTER_LINEAR)
        dark = (close > 0).astype(np.float32)
        share = cv2.resize(dark, (width, height), interpolation=cv2.INTER_AREA)
        return 1 - share[..., None] * (1 - np.array(self.factor, dtype=np.float32))


def smoothed(normal: Normals, height_px: float) -> Normals:
    """Return normals smoothed over facets: artists shade forms. 0 stays 0 beside the figure."""
    there = (normal != 0).any(axis=-1)
    soft = cv2.GaussianBlur(normal.astype(np.float32), (0, 0), max(0.5, SOFT * height_px))
    length = np.linalg.norm(soft, axis=-1, keepdims=True)
    return np.where(there[..., None], soft / np.maximum(length, 1e-6), 0)


def learn_shade(
    paints: Sequence[Paint], normals: Sequence[Normals], clear: Sequence[Mask]
) -> tuple[Shade | None, list[Paint]]:
    """Return the shadow of a sheet, and its drawings' paint in light; None, and they, without one.

    Args:
        paints: the drawings' colours, without lines.
        normals: of the surface that they show, smoothed, in camera axes.
        clear: pixels that show paint of that surface.
    """
    pictures = [np.dstack([paint, np.full(paint.shape[:2], 255, np.uint8)]) for paint in paints]
    beside = [np.where(own, 0, 255).astype(np.uint8) for own in clear]
    shadow = find_shadow(pictures, beside)
    if shadow is None:
        return None, list(paints)
    votes = [border_votes(*each, shadow) for each in zip(pictures, beside, strict=True)]
    sides = [vote != 0 for vote in votes]
    x = np.concatenate([normal[side] for normal, side in zip(normals, sides, strict=True)])
    y = np.concatenate([vote[side] > 0 for vote, side in zip(votes, sides, strict=True)])
    drawing = np.repeat(np.arange(len(sides)), [np.count_nonzero(side) for side in sides])
    x = np.column_stack([x, np.ones(len(x))]).astype(float)
    if not len(y) or _left_out_accuracy(x, y, drawing) < ACCURATE:
        return None, list(paints)
    a, b, c, level = _logistic(x, y).tolist()
    shade = Shade((a, b, c), level, shadow.factor)
    tones = find_tones(pictures, beside, shadow)
    return shade, [_lit(*each, shade) for each in zip(paints, clear, tones, strict=True)]


def _lit(paint: Paint, clear: Mask, dark: Mask, shade: Shade) -> Paint:
    """Return a drawing's paint in light; what mixes both tones at their border is the paint's."""
    color, factor = paint / np.float32(255), np.array(shade.factor, dtype=np.float32)
    light = np.where(dark[..., None], np.minimum(color / factor, 1), color)
    edge = dilate(dark, MIXED_PX) & dilate(~dark, MIXED_PX)
    pure = clear & ~edge
    if pure.any():
        base = light[nearest(pure)]
        low, way = base * factor, base * (1 - factor)
        share = ((color - low) * way).sum(axis=-1) / np.maximum((way**2).sum(axis=-1), 1e-6)
        off = np.abs(color - low - share.clip(0, 1)[..., None] * way).max(axis=-1)
        light = np.where((edge & (off < MIXED))[..., None], base, light)
    return np.rint(light * 255).astype(np.uint8)


def _left_out_accuracy(
    x: Float[np.ndarray, "n 4"], y: Bool[np.ndarray, " n"], group: np.ndarray
) -> float:
    """Return the share of sides that the light of all other drawings tells, mean of both kinds."""
    right = np.zeros(len(y), dtype=bool)
    for number in np.unique(group):
        own = group == number
        if y[~own].any() and (~y[~own]).any():
            right[own] = (x[own] @ _logistic(x[~own], y[~own]) > 0) == y[own]
    return float(np.mean([right[y == kind].mean() if (y == kind).any() else 0 for kind in (0, 1)]))


def _logistic(x: Float[np.ndarray, "n k"], y: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " k"]:
    """Return the coefficients of a logistic regression, by Newton's method."""
    found = np.zeros(x.shape[1])
    ridge = RIDGE * len(y) * np.eye(x.shape[1])
    for _ in range(NEWTON):
        chance = 1 / (1 + np.exp(-np.clip(x @ found, -30, 30)))
        weight = chance * (1 - chance) + 1e-9
        slope = x.T @ (y - chance) - ridge @ found
        found = found + np.linalg.solve(x.T @ (weight[:, None] * x) + ridge, slope)
    return found
