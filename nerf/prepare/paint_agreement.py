"""Refine the drawings' bends until neighbours show the same paint at the same place.

Outlines fix a bend along the outline only; a face or a buckle within still lies elsewhere in every
drawing. Neighbouring drawings show the same places X of the body, so the bends d are those under
which they show the same colours there,

    sum over neighbours i, j and places X that both show, of
        rho |drawn_i(x_i + d_i(x_i)) - drawn_j(x_j + d_j(x_j))|^2        x_i, x_j: where X is seen

beside two priors: bends are smooth and small, and outlines, which agree already, stay where they
are. X lies on the hull. Where the hull is too fat, a drawing's left and right neighbour ask for
opposite displacements, which cancel; what both ask for is its own error.

Colours are compared in the same places: each drawing gets a gain per channel, so that paint that
was mixed anew for every drawing is one paint again.

Source: Lucas and Kanade's residual (1981), coarse to fine, of all drawings at once as in bundle
adjustment; Geman and McClure's robust weights.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import block_diag

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.displacement import CONTROLS, Bends
from toonset.dataset.silhouettes.empirical_bayes import step
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.look.outline import outline_width
from toonset.nerf.prepare.unwarp import Warp, warped
from toonset.raster import depth_inside, nearest

POINTS = 60.0  # places along a length as long as the figure
BLURS = (0.024, 0.012, 0.006)  # of the figure's height: sigma
ROUNDS = 3  # of Gauss-Newton, at each blur
NEIGHBOUR = math.radians(70)  # drawings farther apart show too little in common
SOFT_PX = 2.0  # beyond an outline: ink and paint are mixed
RIM = 0.02  # of the figure's height: nearer to its outline is ink, or the hull is off
BEHIND = 0.03  # of the figure's height: what lies deeper is hidden
FEWEST = 50  # places that two drawings must share
NOISE = 0.2  # of colours at one place
WEIGHT = 60.0  # of a place beside the priors
EXPECTED = 0.004  # of the figure's square: bends that outlines leave
HOLD = 4.0  # of a pixel of the outline, per squared pixel that it moves across itself
EVERY = 3  # of an outline's pixels is held
GAIN, GAIN_NOISE = 0.03, 0.3  # standard deviations: of a drawing's gain; of one place's colour
SAME_PAINT, DARK = 0.12, 0.15  # logarithms apart; below, a channel says nothing of its gain
Depths = Callable[[Camera], Float[np.ndarray, "height width"]]
_BENDS = Bends.expected()
_HALF = CONTROLS**2


@dataclass(frozen=True, eq=False)
class PaintAgreement:
    """Changes of drawings that make their paint agree.

    Attributes:
        applied: whether they were.
        gain_nats: log likelihood ratio of what is painted, after over before, beside the priors.
        moved_px: root mean square displacement, beside what outlines had asked for.
        gains: per drawing, red, green and blue of its paint over the others'.
    """

    applied: bool
    gain_nats: float
    moved_px: float
    gains: tuple[tuple[float, float, float], ...]

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return {
            "applied": self.applied,
            "gain_nats": round(self.gain_nats, 3),
            "moved_px": round(self.moved_px, 4),
            "gains": [[round(value, 4) for value in row] for row in self.gains],
        }


def with_paint_agreed(
    drawn: Scene, straight: Scene, warps: Sequence[Warp], depth_of: Depths, height: float
) -> tuple[Scene, tuple[Warp, ...], PaintAgreement]:
    """Return the scene with drawings bent and tinted so that what they paint agrees.

    Args:
        drawn: the drawings as they are.
        straight: the same, cameras set right, and bent so that outlines agree.
        warps: these bends.
        depth_of: the body's surface as a camera sees it, nan where there is none.
        height: of the figure, world units.

    Returns:
        The scene, every drawing's whole bend, and what was found.
    """
    nothing = PaintAgreement(False, 0.0, 0.0, ())
    figures = _figures(drawn, straight, warps, depth_of, height)
    pairs = _pairs(figures) if figures else []
    if not pairs:
        return straight, tuple(warps), nothing
    begin = [figure.warp.numbers for figure in figures]
    found, gain_nats = _agreed(figures, pairs, begin)
    if gain_nats <= 0:
        return straight, tuple(warps), replace(nothing, gain_nats=gain_nats)
    moves = [figure.moved(a - b) for figure, a, b in zip(figures, found, begin, strict=True)]
    whole, gains = list(warps), np.ones((len(drawn.frames), 3))
    tints = _gains(figures, pairs, found)
    for figure, numbers, tint in zip(figures, found, tints, strict=True):
        whole[figure.number] = Warp(figure.warp.square, numbers)
        gains[figure.number] = tint
    frames = [
        replace(_tinted(warped(frame, warp), tint), camera=placed.camera)
        for frame, placed, warp, tint in zip(
            drawn.frames, straight.frames, whole, gains, strict=True
        )
    ]
    moved_px = float(np.sqrt(np.mean(np.concatenate(moves))))
    rows = tuple((float(r), float(g), float(b)) for r, g, b in gains)
    return (
        replace(straight, frames=tuple(frames)),
        tuple(whole),
        PaintAgreement(True, gain_nats, moved_px, rows),
    )


@dataclass(frozen=True, eq=False)
class _Figure:
    """One drawing that shows a figure.

    Attributes:
        number: of its frame.
        camera: of the drawing.
        paint: (height, width, 3) as drawn, in [0, 1], the nearest paint under its outline.
        mask: (height, width) the figure, outlines agreeing.
        depth: (height, width) of the body past the camera's target, nan beside it.
        warp: under which outlines agree.
        height_px: of the figure.
    """

    number: int
    camera: Camera
    paint: Float[np.ndarray, "height width 3"]
    mask: Bool[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    warp: Warp
    height_px: float

    @cached_property
    def inside(self) -> Bool[np.ndarray, "height width"]:
        """Return the pixels that show the body, away from the outline."""
        inner = depth_inside(self.mask) > RIM * self.height_px
        return inner & np.isfinite(self.depth)

    def basis(self, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n controls"]:
        """Return the weights of the controls at pixels, for a displacement in pixels."""
        square = self.warp.square
        return square.size * _BENDS.jacobian(square.unit(pixels))[:, 0, :_HALF]

    def moved(self, numbers: Float[np.ndarray, " k"]) -> Float[np.ndarray, " n"]:
        """Return the squared displacements over the figure, pixels."""
        rows, columns = np.nonzero(self.inside)
        pixels = np.stack([columns, rows], axis=-1)[:: EVERY**2] + 0.5
        return ((self.basis(pixels) @ numbers.reshape(2, -1).T) ** 2).sum(axis=-1)

    def held(self) -> Float[np.ndarray, "k k"]:
        """Return the information that the outline stays where it is, across itself."""
        distance = (depth_inside(self.mask) - depth_inside(~self.mask)).astype(np.float32)
        smooth = cv2.GaussianBlur(distance, (0, 0), 2)
        rows, columns = np.nonzero(self.mask & (depth_inside(self.mask) < 1))
        rows, columns = rows[::EVERY], columns[::EVERY]
        slope = np.stack(
            [cv2.Sobel(smooth, cv2.CV_32F, *axis)[rows, columns] for axis in ((1, 0), (0, 1))], -1
        )
        normal = slope / np.maximum(np.linalg.norm(slope, axis=-1, keepdims=True), 1e-6)
        basis = self.basis(np.stack([columns, rows], axis=-1) + 0.5)
        across = np.concatenate([normal[:, :1] * basis, normal[:, 1:] * basis], axis=1)
        return HOLD * across.T @ across


@dataclass(frozen=True, eq=False)
class _Pair:
    """Places that two drawings show: which they are, the places' pixels and controls' weights."""

    i: int
    j: int
    pixels: tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]
    basis: tuple[Float[np.ndarray, "n controls"], Float[np.ndarray, "n controls"]]

    def places(self, numbers: Sequence[Float[np.ndarray, " k"]]) -> list[np.ndarray]:
        """Return where the places are drawn in either."""
        both = zip((self.i, self.j), self.pixels, self.basis, strict=True)
        return [pixels + basis @ numbers[k].reshape(2, -1).T for k, pixels, basis in both]


def _figures(
    drawn: Scene, straight: Scene, warps: Sequence[Warp], depth_of: Depths, height: float
) -> list[_Figure]:
    outline_px = float(np.median([outline_width(frame.rgba) for frame in drawn.frames]))
    shown = [i for i, frame in enumerate(straight.frames) if not warps[i].is_none]
    frames = [straight.frames[i] for i in shown]
    return [
        _Figure(
            i,
            frame.camera,
            _paint(drawn.frames[i], outline_px),
            mask_of(frame.rgba),
            depth_of(frame.camera),
            warps[i],
            height * frame.camera.scale,
        )
        for i, frame in zip(shown, frames, strict=True)
    ]


def _paint(frame: Frame, outline_px: float) -> Float[np.ndarray, "height width 3"]:
    mask = mask_of(frame.rgba)
    inner = depth_inside(mask) >= outline_px + SOFT_PX
    rows, columns = nearest(inner if inner.any() else mask)
    return frame.rgba[rows, columns, :3] / np.float32(255)


def _pairs(figures: Sequence[_Figure]) -> list[_Pair]:
    forward = np.stack([figure.camera.rotation[2] for figure in figures])
    near = np.arccos(np.clip(forward @ forward.T, -1, 1)) <= NEIGHBOUR
    pairs = []
    for i, one in enumerate(figures):
        step = max(1, round(one.height_px / POINTS))
        grid = np.zeros_like(one.inside)
        grid[::step, ::step] = one.inside[::step, ::step]
        rows, columns = np.nonzero(grid)
        pixels = np.stack([columns, rows], axis=-1) + 0.5
        points = one.camera.unproject(pixels, one.depth[rows, columns])
        for j in np.flatnonzero(near[i]).tolist():
            if j == i:
                continue
            other = figures[j]
            there, depth, front = other.camera.project(points)
            size = np.array(other.camera.size_wh)
            at = np.floor(np.nan_to_num(there, nan=-1)).astype(int)
            seen = front & (at >= 0).all(axis=1) & (at < size).all(axis=1)
            column, row = np.where(seen[:, None], at, 0).T
            slack = BEHIND * other.height_px / other.camera.scale
            behind = depth - np.nan_to_num(other.depth[row, column], nan=-np.inf)
            seen &= other.inside[row, column] & (behind <= slack)
            if seen.sum() >= FEWEST:
                both = (pixels[seen], there[seen])
                basis = (one.basis(both[0]), other.basis(both[1]))
                pairs.append(_Pair(i, int(j), both, basis))
    return pairs


def _agreed(
    figures: Sequence[_Figure], pairs: Sequence[_Pair], begin: list[Float[np.ndarray, " k"]]
) -> tuple[list[Float[np.ndarray, " k"]], float]:
    """Return the numbers under which paint agrees, and the gain of log likelihood."""
    k = 2 * _HALF
    prior = np.linalg.inv(_BENDS.covariance) / EXPECTED**2
    priors = [prior + figure.held() for figure in figures]
    precision = np.asarray(block_diag(*priors))
    numbers, gain = begin, 0.0
    for blur in BLURS:
        layers = [_slopes(figure.paint, blur * figure.height_px) for figure in figures]
        for _ in range(ROUNDS):
            matrix, slope = np.zeros((len(figures) * k,) * 2), np.zeros(len(figures) * k)
            for pair in pairs:
                _add(matrix, slope, pair, layers, numbers)
            off = np.concatenate(numbers) - np.concatenate(begin)
            moves = step(matrix, slope, precision, off).reshape(len(figures), k)
            numbers = [old - move for old, move in zip(numbers, moves, strict=True)]
        gain = (_cost(layers, pairs, begin) - _cost(layers, pairs, numbers)) / 2
    moved = [after - old for after, old in zip(numbers, begin, strict=True)]
    spent = sum(float(d @ own @ d) for d, own in zip(moved, priors, strict=True))
    return numbers, gain - spent / 2


def _slopes(
    picture: Float[np.ndarray, "height width 3"], sigma: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a blurred picture and its slopes per pixel."""
    soft = cv2.GaussianBlur(picture, (0, 0), sigma)
    across, down = (cv2.Scharr(soft, cv2.CV_32F, *axis) / 32 for axis in ((1, 0), (0, 1)))
    return soft, across, down


def _cost(layers: Sequence[Any], pairs: Sequence[_Pair], numbers: Sequence[np.ndarray]) -> float:
    total = 0.0
    for pair in pairs:
        a, b = (
            _read(layers[k][0], at)
            for k, at in zip((pair.i, pair.j), pair.places(numbers), strict=True)
        )
        square = ((a - b) ** 2).sum(axis=-1) / NOISE**2
        total += WEIGHT * float((square / (1 + square)).sum())
    return total


def _add(
    matrix: np.ndarray,
    slope: np.ndarray,
    pair: _Pair,
    layers: Sequence[Any],
    numbers: Sequence[np.ndarray],
) -> None:
    """Add a pair's Gauss-Newton terms."""
    a, b = (
        [_read(layer, at) for layer in layers[k]]
        for k, at in zip((pair.i, pair.j), pair.places(numbers), strict=True)
    )
    apart = a[0] - b[0]
    across, down = (a[1] + b[1]) / 2, (a[2] + b[2]) / 2
    weight = WEIGHT / NOISE**2 / (1 + (apart**2).sum(axis=-1) / NOISE**2) ** 2
    xx, xy, yy = (
        weight * (p * q).sum(axis=-1) for p, q in ((across, across), (across, down), (down, down))
    )
    pull = [weight * (way * apart).sum(axis=-1) for way in (across, down)]
    k = 2 * _HALF
    sides = ((pair.i, 1.0, pair.basis[0]), (pair.j, -1.0, pair.basis[1]))
    for one, sign, basis in sides:
        at = slice(one * k, (one + 1) * k)
        slope[at] += sign * np.concatenate([basis.T @ part for part in pull])
        for other, turn, theirs in sides:
            there = slice(other * k, (other + 1) * k)
            x, y, mixed = (basis.T @ (part[:, None] * theirs) for part in (xx, yy, xy))
            matrix[at, there] += sign * turn * np.block([[x, mixed], [mixed, y]])


def _gains(
    figures: Sequence[_Figure], pairs: Sequence[_Pair], numbers: Sequence[np.ndarray]
) -> Float[np.ndarray, "figures 3"]:
    """Return the factors that make every drawing's colours the mean of all, channel by channel."""
    count = len(figures)
    matrix = np.stack([np.eye(count) / GAIN**2] * 3)
    right = np.zeros((3, count))
    for pair in pairs:
        a, b = (
            _read(figures[k].paint, at)
            for k, at in zip((pair.i, pair.j), pair.places(numbers), strict=True)
        )
        bright = np.minimum(a, b) > DARK
        ratios = np.log(np.where(bright, b, 1)) - np.log(np.where(bright, a, 1))
        alike = np.abs(ratios).max(axis=-1) < SAME_PAINT
        for channel in range(3):
            told = alike & bright[:, channel]
            if told.sum() < FEWEST:
                continue
            ratio = float(np.median(ratios[told, channel]))
            weight = told.sum() / GAIN_NOISE**2
            for k, sign in ((pair.i, 1.0), (pair.j, -1.0)):
                right[channel, k] += sign * weight * ratio
                matrix[channel, k, k] += weight
            matrix[channel, pair.i, pair.j] -= weight
            matrix[channel, pair.j, pair.i] -= weight
    return np.exp(np.linalg.solve(matrix, right[..., None])[..., 0].T)


def _tinted(frame: Frame, gains: Float[np.ndarray, " 3"]) -> Frame:
    colors = (frame.rgba[..., :3] * gains + 0.5).clip(0, 255).astype(np.uint8)
    return replace(frame, rgba=np.dstack([colors, frame.rgba[..., 3]]))


def _read(
    picture: Float[np.ndarray, "height width 3"], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    x, y = (np.ascontiguousarray(pixels[:, None, k] - 0.5, dtype=np.float32) for k in (0, 1))
    return cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[:, 0]
