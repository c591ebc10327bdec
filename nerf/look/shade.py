"""Learn a two-tone shadow whose light stays with the viewer; remove it and cast it anew.

    shadow where  slope . n + level > 0,     colour in shadow = factor * colour in light

n is the surface's normal in camera axes, a little smoothed. The factor is the commonest ratio of
colours across borders that darken every channel: a shadow's border runs over all paints, borders
of paint do not agree. Borders with this ratio say which side lies in shadow, and logistic
regression on their normals says where the light stands. There is such a shadow if the light that
all other drawings show tells a drawing's sides apart.

Sources: ratios across shadow borders, Barnard and Finlayson, "Shadow identification using colour
ratios", 2000; toon shading by a threshold on the normal, Lake et al. 2000.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter

from toonset.raster import nearest

SIDE_PX = 3  # from a border to where the colours on both its sides are read
FLAT = 0.03  # logarithms per pixel: steeper is not a flat paint
BETWEEN = 0.1  # logarithms: a line between the sides is darker than both by more
LEAST_DROP = 0.1  # logarithms, mean of the channels: weaker shadows are noise
CELL, MOST_DROP = 0.05, 1.4  # logarithms: of the ratios' histogram
ALIKE = 0.1  # logarithms that a channel's ratio may be off the factor
FLOOR = 0.015  # of 1, added before logarithms: black says nothing of ratios
FEWEST = 200  # borders, to speak of a commonest ratio
LONG = 1.5  # times the figure's height, per drawing: pixels beside a shadow's borders
DARKEST = 0.8  # logarithms, mean of the channels: deeper is another paint
ACCURATE = 0.68  # of a left-out drawing's sides must be told
RIDGE, NEWTON = 1e-4, 12
SOFT = 0.012  # of the figure's height: sigma by which normals are smoothed
SURE, SPREAD, SIMILAR = (
    8.0,
    300.0,
    6.0,
)  # of a border's vote; of its spreading, and over which levels
STEEPEST = 4.0  # logits that normals may say
MIXED_PX, MIXED = 2, 0.06  # beside a border between tones; colours off a mixture of both

Picture = Float[np.ndarray, "height width 3"]
Normals = Float[np.ndarray, "height width 3"]
Clear = Bool[np.ndarray, "height width"]


@dataclass(frozen=True)
class Shade:
    """A shadow; see the module's equation.

    Attributes:
        slope: of the normal, in camera axes.
        level: of a surface without slope.
        factor: red, green and blue in shadow over those in light.
    """

    slope: tuple[float, float, float]
    level: float
    factor: tuple[float, float, float]

    def logit(self, normal: Normals) -> Float[np.ndarray, "height width"]:
        """Return the logarithm of how much likelier shadow is than light."""
        return np.asarray(normal @ np.array(self.slope, np.float32) + np.float32(self.level))

    def tone(self, normal: Normals, finer: int) -> Picture:
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


def learned_shade(
    paints: Sequence[Picture], normals: Sequence[Normals], clear: Sequence[Clear], height_px: float
) -> Shade | None:
    """Return the shadow of a sheet; None without one.

    Args:
        paints: the drawings' colours in [0, 1].
        normals: of the surface that they show, `smoothed`, in camera axes.
        clear: pixels that show paint of that surface.
        height_px: of the figure.
    """
    ratios = [_ratios(paint, where) for paint, where in zip(paints, clear, strict=True)]
    drop = _commonest(np.concatenate([each for ratio in ratios for _, each, _ in ratio]))
    if drop is None:
        return None
    sides, dark, drawing = [], [], []
    for number, (ratio, normal) in enumerate(zip(ratios, normals, strict=True)):
        votes = _votes(ratio, drop, normal.shape[:2])
        sides.append(normal[votes != 0])
        dark.append(votes[votes != 0] > 0)
        drawing.append(np.full(len(sides[-1]), number))
    x, y, group = (np.concatenate(each) for each in (sides, dark, drawing))
    x = np.column_stack([x, np.ones(len(x))]).astype(float)
    if len(y) < LONG * height_px * len(paints) or _left_out_accuracy(x, y, group) < ACCURATE:
        return None
    a, b, c, level = _logistic(x, y).tolist()
    red, green, blue = np.exp(drop).tolist()
    return Shade((a, b, c), level, (red, green, blue))


def unlit(paint: Picture, normal: Normals, clear: Clear, shade: Shade) -> Picture:
    """Return a drawing's colours as they are in light.

    Borders of the factor's ratio and normals vote for light or shadow; votes spread over paint of
    similar colour, so tones end where the drawing's own borders are.

    Args:
        paint: in [0, 1].
        normal: `smoothed`.
        clear: as of `learned_shade`.
        shade: of the sheet.
    """
    factor = np.array(shade.factor, dtype=np.float32)
    votes = _votes(_ratios(paint, clear), np.log(factor), clear.shape)
    said = np.clip(shade.logit(normal), -STEEPEST, STEEPEST) + SURE * votes
    weight = (clear * (1 + 2 * np.abs(votes))).astype(np.float32)
    guide = _without_noise(paint)
    total, mean = (
        cv2.ximgproc.fastGlobalSmootherFilter(guide, values.astype(np.float32), SPREAD, SIMILAR)
        for values in (weight, said * weight)
    )
    dark = (mean > 0) & (total > 0)
    light = np.where(dark[..., None], np.minimum(paint / factor, 1), paint).astype(np.float32)
    side = 2 * MIXED_PX + 1
    edge = cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((side, side))) > 0
    pure = clear & ~edge
    if not pure.any():
        return light
    base = light[nearest(pure)]
    low, way = base * factor, base * (1 - factor)
    share = ((paint - low) * way).sum(axis=-1) / np.maximum((way**2).sum(axis=-1), 1e-6)
    off = np.abs(paint - low - share.clip(0, 1)[..., None] * way).max(axis=-1)
    return np.where((edge & (off < MIXED))[..., None], base, light)


Ratio = tuple[tuple[np.ndarray, ...], Float[np.ndarray, "n 3"], tuple[int, int]]


def _ratios(paint: Picture, clear: Clear) -> list[Ratio]:
    """Return borders between flat colours, one direction after the other.

    Of each border: its pixel; the logarithms of the colours behind it less those before it; the
    way (rows, columns) from one side to the other.
    """
    logs = np.log(_without_noise(paint) / np.float32(255) + np.float32(FLOOR))
    light = logs.mean(axis=-1)
    across, down = (cv2.Sobel(light, cv2.CV_32F, *axis) / 8 for axis in ((1, 0), (0, 1)))
    flat = clear & (np.hypot(across, down) < FLAT)
    flat[:SIDE_PX] = flat[-SIDE_PX:] = flat[:, :SIDE_PX] = flat[:, -SIDE_PX:] = False
    found = []
    for way in ((0, 1), (1, 0), (1, 1), (1, -1)):
        before, after = (_moved(logs, way, steps) for steps in (-SIDE_PX, SIDE_PX))
        between = [_moved(light, way, steps) for steps in range(1 - SIDE_PX, SIDE_PX)]
        ends = np.stack([before.mean(axis=-1), after.mean(axis=-1)])
        border = _moved(flat, way, -SIDE_PX) & _moved(flat, way, SIDE_PX)
        border &= np.min(between, axis=0) > ends.min(axis=0) - BETWEEN
        border &= np.max(between, axis=0) < ends.max(axis=0) + BETWEEN
        border &= np.abs(ends[1] - ends[0]) > LEAST_DROP
        found.append((np.nonzero(border), (after - before)[border], way))
    return found


def _moved(values: np.ndarray, way: tuple[int, int], steps: int) -> np.ndarray:
    """Return the values so many steps along a way from every pixel."""
    return np.roll(values, (-steps * way[0], -steps * way[1]), (0, 1))


def _without_noise(paint: Picture) -> np.ndarray:
    return cv2.bilateralFilter((paint * 255).astype(np.uint8), 5, 30, 3)


def _commonest(ratios: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " 3"] | None:
    """Return the commonest ratio that darkens every channel, logarithms; None without any."""
    drops = np.where(ratios.mean(axis=1, keepdims=True) > 0, -ratios, ratios)
    drops = drops[(drops < 0).all(axis=1) & (drops > -MOST_DROP).all(axis=1)]
    if len(drops) < FEWEST:
        return None
    edges = [np.arange(-MOST_DROP, CELL / 2, CELL)] * 3
    counts, _ = np.histogramdd(drops, edges)
    best = np.unravel_index(uniform_filter(counts, 3, mode="constant").argmax(), counts.shape)
    middle = -MOST_DROP + CELL * (np.array(best) + 0.5)
    drop = np.median(drops[(np.abs(drops - middle) <= 1.5 * CELL).all(axis=1)], axis=0)
    return drop if -DARKEST <= drop.mean() <= -LEAST_DROP else None


def _votes(
    ratios: Sequence[Ratio], drop: Float[np.ndarray, " 3"], shape: tuple[int, ...]
) -> Float[np.ndarray, "height width"]:
    """Return votes for shadow (> 0) and light (< 0) of the pixels beside borders with a ratio."""
    votes = np.zeros(shape, dtype=np.float32)
    for (rows, columns), change, (down, right) in ratios:
        for sign in (1, -1):
            hit = np.abs(sign * change - drop).max(axis=1) < ALIKE
            for side in (1, -1):
                steps = side * SIDE_PX
                np.add.at(
                    votes, (rows[hit] + steps * down, columns[hit] + steps * right), side * sign
                )
    return np.clip(votes, -2, 2)


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
