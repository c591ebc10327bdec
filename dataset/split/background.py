"""Estimate a sheet's background and its noise, and each pixel's difference from it.

No more is modelled than the border asks for: one colour; else a quadratic gradient; else a smooth
field (`toonset.dataset.split.background_field`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.images.jpeg_noise import halo_levels, has_jpeg_grid
from toonset.dataset.split.background_field import Field, fit_gradient, fit_smooth
from toonset.dataset.split.background_pattern import BINS, Plate, fit_pattern
from toonset.dataset.split.background_zones import CLOSE, fit_backdrop, fit_steps
from toonset.errors import SheetError
from toonset.view import Box, over_white

CLUSTER_RADIUS = 32  # levels: border pixels this near to the background are background + noise
LEAST_TOLERANCE = 2  # levels: a picture without noise still holds rounding
MOST_TOLERANCE = 48  # levels: beyond it figures would be eaten, whatever the noise
FAR = 0.1  # of the shorter side from everything drawn: soft edges and glows end nearer
COMMON_ALPHA = 0.001  # of what is far: an alpha that is the ground's
MOST_RESIDUAL = 32  # alpha: more is paint
TRANSPARENT = 0.01  # of the sheet: less see-through area is an accident, not a background
STEADY = 1.5  # times the 99th percentile of noise: the 99.99th of a normal distribution
RIPPLED = 2.0  # the same in JPEG, whose ripples are stronger near figures than in the border
GRAIN = 2.0  # levels: paper with more has grain all over, beside which no ripples are seen
RARE = 3.0  # times the 80th percentile of noise: where its 99th may lie
SURE_ENOUGH = 0.9  # of the border in one colour: less is worth a warning
LEAST_SURE = 0.3  # of the border: less in one colour is not background
WORTH = 0.7  # of the simpler background's noise: a richer one must leave less
WORTH_LEVELS = 2.0  # and less by so many levels
WORTH_SHARE = 0.05  # of the border: or explain so much more of it
CLEARLY = 0.98  # of the border in one colour with less noise than that: nothing to gain
RING = 0.02  # of the shorter side: the border that is looked at
INSETS = (0.0, 0.02, 0.04, 0.06, 0.08)  # of the shorter side: where it is looked for
COMMON = 0.3  # of the sheet: a colour that covers less is not background but a frame
SECOND = 0.1  # of the sheet in one colour that is not the border's: it may be a panel
MOST_SAMPLES = 200_000  # border pixels that are looked at


@dataclass(frozen=True, eq=False)
class Background:
    """The background of a sheet.

    Attributes:
        rgb: its typical colour; None where the sheet has an alpha channel of its own.
        field: how the colour changes over the sheet; None where it does not.
        kind: "transparent", "plain", "gradient", "uneven", "patterned" or "stepped".
        sure: share of the border that is background, 0 to 1.
        noise: of 99 % of the border, in levels.
        grain: of 80 % of the border, in levels: what is all over the sheet.
        tolerance: largest difference of a channel, in levels, that is still background.
        evidence: why this kind and not a simpler one, for people; "" for the simplest.
        inset: share of the shorter side at which it begins: more than 0 inside of a thick frame.
    """

    rgb: tuple[int, int, int] | None
    field: Field | Plate | None
    kind: str
    sure: float
    noise: float
    grain: float
    tolerance: int
    evidence: str = ""
    inset: float = 0.0

    def colors(self, box: Box) -> UInt8[np.ndarray, "height width 3"]:
        """Return the background's colour in a window (x, y, width, height) of the sheet."""
        if self.field is not None:
            return self.field.colors(box)
        return np.broadcast_to(np.array(self.rgb, dtype=np.uint8), (box[3], box[2], 3))

    def __str__(self) -> str:
        """Return what it is, for people."""
        if self.rgb is None:
            return "transparent background"
        color = "#{:02x}{:02x}{:02x}".format(*self.rgb)
        return f"{self.kind} background {color}" + (f" ({self.evidence})" if self.evidence else "")


def find_background(
    rgba: UInt8[np.ndarray, "height width 4"], known_rgb: tuple[int, int, int] | None = None
) -> Background:
    """Return the background of a sheet: its transparency, else what its border shows.

    The tolerance comes from the border's own noise, so that JPEG sheets and textured paper work
    and white shirts on an almost white ground survive.

    Args:
        rgba: the sheet.
        known_rgb: the colour, where a person gives it.

    Raises:
        SheetError: the border has no dominant colour.
    """
    if is_transparent(rgba) and known_rgb is None:
        return Background(None, None, "transparent", _sure_of_alpha(rgba), 0.0, 0.0, 0)
    inset = _inset(rgba)
    height, width = rgba.shape[:2]
    places = _samples(ring_of(height, width, inset))
    colors = rgba[places][:, :3]
    if known_rgb is not None:
        known = _judged("plain", None, known_rgb, colors, np.array(known_rgb))
        return replace(known, inset=inset)
    found = _pattern(rgba, places, colors) or _richest_worth_it(rgba, places, colors, inset)
    if found.kind in ("gradient", "uneven") or found.sure < SURE_ENOUGH:
        steps = _steps(rgba, places, colors, inset)
        if steps is not None and (found.sure < SURE_ENOUGH or _is_worth_it(steps, found)):
            found = steps
    found = _backdrop(rgba, places, colors, inset, found) or found
    found = replace(found, inset=inset)
    if found.sure < LEAST_SURE:
        raise SheetError(
            f"the background is not one colour (the commonest takes {found.sure:.0%} of the "
            "border); put the figures on a plain or a transparent background, name its colour "
            "with --background '#rrggbb', or take them off with --matting"
        )
    return found


def is_transparent(rgba: UInt8[np.ndarray, "height width 4"]) -> bool:
    """Return whether the sheet's own alpha tells the figures from the background."""
    return float(np.count_nonzero(rgba[..., 3] < 128)) / rgba[..., 3].size > TRANSPARENT


def remove_residual_alpha(
    rgba: UInt8[np.ndarray, "height width 4"],
) -> tuple[UInt8[np.ndarray, "height width 4"], int]:
    """Return a transparent sheet without the alpha that its ground has, and that alpha.

    Layers at 1 %, noise and smears leave a little alpha where nothing is drawn. The ground's alpha
    is the largest that is common far from what is drawn; the figures are un-mixed from it.
    """
    alpha = rgba[..., 3]
    drawn = (alpha >= 128).view(np.uint8)
    reach = 2 * round(max(8, FAR * min(drawn.shape))) + 1
    far = cv2.dilate(drawn, np.ones((reach, reach), np.uint8)) == 0
    often = np.bincount(alpha[far], minlength=256) > COMMON_ALPHA * np.count_nonzero(far)
    level = int(np.flatnonzero(often[: MOST_RESIDUAL + 1]).max(initial=0))
    if level == 0:
        return rgba, 0
    scaled = (np.arange(256) - level) * 255 / (255 - level)
    table = np.clip(np.rint(scaled), 0, 255).astype(np.uint8)
    return np.dstack([rgba[..., :3], table[alpha]]), level


def flatten(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width 4"]:
    """Return an opaque picture: what is see-through shows white paper."""
    if (rgba[..., 3] == 255).all():
        return rgba
    rgb = np.rint(255 * over_white(rgba)).astype(np.uint8)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def difference(
    rgb: UInt8[np.ndarray, "height width 3"], ground: UInt8[np.ndarray, "height width 3"]
) -> UInt8[np.ndarray, "height width"]:
    """Return the largest difference of any channel from the background, in levels."""
    result = cv2.absdiff(rgb[..., 0], np.ascontiguousarray(ground[..., 0]))
    for channel in (1, 2):
        apart = cv2.absdiff(rgb[..., channel], np.ascontiguousarray(ground[..., channel]))
        cv2.max(result, apart, dst=result)
    return np.asarray(result, dtype=np.uint8)


def of_paper(
    rgba: UInt8[np.ndarray, "height width 4"],
    picture: UInt8[np.ndarray, "height width 3"],
    paper: Bool[np.ndarray, "height width"],
    sure: float,
) -> Background:
    """Return the background of a panel of which some paper is known.

    Args:
        rgba: the sheet.
        picture: what it would show without its figures.
        paper: pixels on which nothing is drawn.
        sure: share of its border that is background.
    """
    places = _samples(paper)
    colors = rgba[places][:, :3]
    plate = Plate(picture, _dominant(colors), "within the picture")
    judged = _judged("panel", plate, plate.typical, colors, plate.sampled(places))
    return replace(judged, sure=sure, evidence=plate.evidence)


def with_final_tolerance(ground: Background, away: UInt8[np.ndarray, "height width"]) -> Background:
    """Return the background with the tolerance that the whole sheet asks for.

    Args:
        ground: what the border shows.
        away: difference of every pixel from the background, in levels.
    """
    if has_jpeg_grid(away, ground.grain):
        levels = max(RIPPLED * ground.noise, halo_levels(away, MOST_TOLERANCE, ripples=True))
        return replace(ground, tolerance=_clipped(levels))
    if ground.grain > GRAIN:
        return ground
    halo = halo_levels(away, MOST_TOLERANCE)
    return replace(ground, tolerance=max(ground.tolerance, halo))


def ring_of(height: int, width: int, inset: float = 0.0) -> Bool[np.ndarray, "height width"]:
    """Return the pixels near the border: 2 % of the shorter side, so a thin frame is outvoted.

    Args:
        height: of the sheet.
        width: of the sheet.
        inset: share of the shorter side at which the ring begins.
    """
    begin = round(inset * min(height, width))
    end = begin + max(3, round(RING * min(height, width)))
    ring = np.zeros((height, width), dtype=bool)
    ring[begin : height - begin, begin : width - begin] = True
    ring[end : height - end, end : width - end] = False
    return ring


def _sure_of_alpha(rgba: np.ndarray) -> float:
    return float((rgba[..., 3][ring_of(rgba.shape[0], rgba.shape[1])] < 128).mean())


def _inset(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return where the background begins: inside of frames, whose colour is on the rim alone."""
    height, width = rgba.shape[:2]
    step = max(1, round((height * width / MOST_SAMPLES) ** 0.5))
    everywhere = rgba[::step, ::step, :3].reshape(-1, 3)
    for inset in INSETS:
        rim = _dominant(rgba[_samples(ring_of(height, width, inset))][:, :3])
        near = np.abs(everywhere - np.array(rim, dtype=np.int16)).max(axis=1) <= CLUSTER_RADIUS
        if near.mean() >= COMMON:
            return inset
    return 0.0


def _samples(ring: Bool[np.ndarray, "height width"]) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of evenly picked border pixels."""
    rows, columns = np.nonzero(ring)
    step = max(1, len(rows) // MOST_SAMPLES)
    return rows[::step], columns[::step]


def _pattern(
    rgba: np.ndarray, places: tuple[np.ndarray, np.ndarray], colors: np.ndarray
) -> Background | None:
    """Return the background that repeats, if it does."""
    plate = fit_pattern(np.ascontiguousarray(rgba[..., :3]), _dominant(colors))
    return _of_plate("patterned", plate, places, colors)


def _steps(
    rgba: np.ndarray, places: tuple[np.ndarray, np.ndarray], colors: np.ndarray, inset: float
) -> Background | None:
    """Return the background of several zones, if the border is in several."""
    rgb = np.ascontiguousarray(rgba[..., :3])
    return _of_plate(
        "stepped", fit_steps(rgb, ring_of(rgb.shape[0], rgb.shape[1], inset)), places, colors
    )


def _backdrop(
    rgba: np.ndarray,
    places: tuple[np.ndarray, np.ndarray],
    colors: np.ndarray,
    inset: float,
    found: Background,
) -> Background | None:
    """Return a graphic backdrop, if the border or a second large colour asks for it."""
    of_one_color = found.sure >= SURE_ENOUGH and found.kind != "stepped"
    if of_one_color and (found.kind != "plain" or not _has_second_color(rgba, found.rgb)):
        return None
    rgb = np.ascontiguousarray(rgba[..., :3])
    ring = ring_of(rgb.shape[0], rgb.shape[1], inset)
    plate = fit_backdrop(rgb, ring, only_panels=of_one_color)
    backdrop = _of_plate("stepped", plate, places, colors)
    if backdrop is None or of_one_color:
        return backdrop
    return replace(backdrop, tolerance=max(backdrop.tolerance, CLOSE))  # zones hold faint facets


def _has_second_color(rgba: np.ndarray, rgb: tuple[int, int, int] | None) -> bool:
    """Return whether a colour other than the background's covers as much as a panel."""
    step = max(1, round((rgba.shape[0] * rgba.shape[1] / MOST_SAMPLES) ** 0.5))
    colors = rgba[::step, ::step, :3].reshape(-1, 3)
    other = colors[np.abs(colors - np.array(rgb, dtype=np.int16)).max(axis=1) > LEAST_TOLERANCE]
    if len(other) < SECOND * len(colors):
        return False
    bins = (other // BINS).astype(np.int64) @ (BINS * BINS, BINS, 1)
    return bool(np.bincount(bins).max() >= SECOND * len(colors))


def _of_plate(
    kind: str, plate: Plate | None, places: tuple[np.ndarray, np.ndarray], colors: np.ndarray
) -> Background | None:
    if plate is None:
        return None
    found = _judged(kind, plate, plate.typical, colors, plate.sampled(places))
    return replace(found, evidence=plate.evidence)


def _richest_worth_it(
    rgba: np.ndarray, places: tuple[np.ndarray, np.ndarray], colors: np.ndarray, inset: float
) -> Background:
    """Return the plain background, or a gradient or smooth field where the border asks for it."""
    dominant = _dominant(colors)
    best = _judged("plain", None, dominant, colors, np.array(dominant))
    if best.sure >= CLEARLY and best.noise <= WORTH_LEVELS:
        return best
    gradient = fit_gradient(rgba, inset)
    for kind, field in (("gradient", gradient), ("uneven", fit_smooth(rgba, gradient))):
        expected = field.sampled(places)
        richer = _judged(kind, field, field.typical, colors, expected)
        if not _is_worth_it(richer, best):
            continue
        evidence = (
            f"noise {richer.noise:g} levels, {best.noise:g} if it were "
            f"{best.kind}; {richer.sure:.0%} of the border, {best.sure:.0%} if it were"
        )
        best = replace(richer, evidence=evidence)
    return best


def _is_worth_it(richer: Background, simpler: Background) -> bool:
    quieter = richer.noise <= WORTH * simpler.noise
    quieter &= richer.noise <= simpler.noise - WORTH_LEVELS
    if quieter:
        return richer.sure >= simpler.sure - WORTH_SHARE
    no_noisier = richer.noise <= simpler.noise / WORTH
    return no_noisier and richer.sure >= simpler.sure + WORTH_SHARE


def _judged(
    kind: str,
    field: Field | Plate | None,
    rgb: tuple[int, int, int],
    colors: UInt8[np.ndarray, "n 3"],
    expected: Float[np.ndarray, "*n 3"],
) -> Background:
    """Return a background with its share of the border and the tolerance that its noise asks."""
    away = np.abs(colors - expected.astype(np.float32)).max(axis=1)
    near = away <= CLUSTER_RADIUS
    # no more than the common noise explains, lest a shadow in the border counts as noise
    common, rare = np.percentile(away[near], [80, 99]) if near.any() else (0.0, 0.0)
    noise = min(float(rare), RARE * float(common) + LEAST_TOLERANCE)
    noise = max(noise, LEAST_TOLERANCE / 2)
    return Background(
        rgb, field, kind, float(near.mean()), noise, float(common), _clipped(STEADY * noise)
    )


def _clipped(levels: float) -> int:
    return int(np.clip(np.ceil(levels), LEAST_TOLERANCE, MOST_TOLERANCE))


def _dominant(colors: UInt8[np.ndarray, "n 3"]) -> tuple[int, int, int]:
    """Return the dominant colour of the border."""
    best = np.median(colors, axis=0)
    share = -1.0
    for shift in (0, BINS // 2):  # two grids: a colour on the edge of a bin is whole in the other
        bins = (colors.astype(np.int64) + shift) // BINS
        codes = bins @ np.array([289, 17, 1])
        code, count = np.unique(codes, return_counts=True)
        if count.max() / len(colors) > share:
            share = float(count.max() / len(colors))
            best = np.median(colors[codes == code[count.argmax()]], axis=0)
    near = np.abs(colors - best).max(axis=1) <= CLUSTER_RADIUS
    red, green, blue = (round(float(x)) for x in np.median(colors[near], axis=0))
    return red, green, blue
