"""Fit backgrounds of several smooth zones: a horizon, two halves, bands, panels behind figures.

Zones that together take the border are one ground with steps. At a step the picture passes from
one zone's colour to the other's, so both and what lies between them are ground where the two meet.

Graphic backdrops are laid of many zones. From the border on, a zone is of the backdrop if it meets
those that are already in straight steps: figures have curved outlines, or lines around them.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.images.zones import Meetings, Zones, find_meetings, find_zones, shrunk
from toonset.dataset.split.background_field import Field, fit_zone
from toonset.dataset.split.background_pattern import Plate
from toonset.dataset.split.figures.grouping import SWATCH
from toonset.raster import dilate, from_nearest, parts

LONGEST_PX = 1600  # of the copy in which steps are looked for
PANELS_PX = 1200  # of the copy in which panels are looked for
LEAST_PIECE = 0.0005  # of the sheet: a smaller patch is no zone
LEAST_ZONE = 0.06  # of the border
TOGETHER = 0.9  # of the border
LEAST_STEP = 12  # levels: a fainter one is noise
LEAST_PATCH = 0.01  # of the sheet: figures part a zone into patches of its colour
CLOSE = 8  # levels from the zone's colour
STEP_PX = 6  # half the width of a step
LEAST_FACET = 0.0001  # of the sheet: a smaller patch is no zone of a backdrop
FLAT = 0.5  # of a zone in its median colour: the others slope or are patterned
LEAST_MEETING = 0.06  # of the shorter side: so long is the straight edge on which zones meet
ON_EDGES = 0.6  # of the length on which a zone meets the backdrop
ALL_ALONG = 0.8  # the same of thin zones: frames of panels, no outlines of figures
WIDE = 0.5  # of the sheet's width: a zone cut off from the border may have a colour of its own
SHADE = 32  # levels from such colours: other zones that are cut off
ALL_ROUND = 0.9  # of its outline: a zone with so much backdrop around it lies on it
LEAST_PANEL = 0.1  # of the sheet
SHOWN = 0.3  # of a panel that is not drawn on: less is a frame
WITHIN = 0.5  # of what is drawn on a panel: heads and feet stand over its edges
LEAST_SIDE = 0.5  # of each side of a panel that shows: corners that are cut out take the rest
STANDING = 0.6  # of a panel's height: a drawing as high stands on it


def fit_steps(
    rgb: UInt8[np.ndarray, "height width 3"], ring: Bool[np.ndarray, "height width"]
) -> Plate | None:
    """Return a background of several zones that together take the border; None if none do.

    Args:
        rgb: the sheet.
        ring: its border.
    """
    size_wh = rgb.shape[1], rgb.shape[0]
    small, shrink = shrunk(rgb, LONGEST_PX)
    zones = find_zones(small, shrink, LEAST_PIECE)
    groups = _of_one_color(zones, small, _outermost(ring, zones.labels.shape))
    if len(groups) < 2:
        return None
    masks, fields = [], []
    for numbers in groups:
        mask = zones.mask(numbers, size_wh)
        field = fit_zone(rgb, mask)
        away = cv2.absdiff(rgb, field.colors((0, 0, *size_wh))).max(axis=2)
        masks.append((away <= CLOSE) & dilate(mask, STEP_PX + round(1 / zones.shrink)))
        fields.append(field)
    taken = np.any(masks, axis=0)
    typical = [np.array(field.typical) for field in fields]
    step = max(int(np.abs(a - b).max()) for a in typical for b in typical)
    if taken[ring].mean() < TOGETHER or step < LEAST_STEP:
        return None
    return Plate(_laid(rgb, masks, fields), fields[0].typical, f"{len(groups)} zones at its border")


def fit_backdrop(
    rgb: UInt8[np.ndarray, "height width 3"],
    ring: Bool[np.ndarray, "height width"],
    *,
    only_panels: bool,
) -> Plate | None:
    """Return a background of zones that meet in straight steps, from the border on; None if none.

    Args:
        rgb: the sheet.
        ring: its border.
        only_panels: the border is one colour: what is added must be panels that figures stand on.
    """
    small, shrink = shrunk(rgb, PANELS_PX if only_panels else LONGEST_PX)
    zones = find_zones(small, shrink, LEAST_FACET)
    border = _outermost(ring, zones.labels.shape)
    at_border = np.bincount(zones.labels[border], minlength=zones.count + 1)
    seeds = at_border >= LEAST_ZONE * at_border.sum()
    seeds[0] = False
    if not seeds.any():
        return None
    values, flat = _values(zones, small)
    meetings = find_meetings(zones, values, small)
    away = _distances(zones, values)
    if only_panels:
        other = np.asarray((away[:, seeds] >= LEAST_STEP).all(axis=1))
        ground = seeds | _panels(_joined(seeds, other, meetings, zones) & ~seeds, seeds, zones)
        found = bool((ground & ~seeds).any())
    else:
        possible = flat & _may_be_backdrop(at_border > 0, away, zones)
        ground = _joined(seeds & flat, possible, meetings, zones)
        shares = [known[zones.grown[border]].mean() for known in (seeds, ground)]
        alike = away[np.ix_(seeds, seeds)].max() < LEAST_STEP  # such a border shows no steps
        found = shares[1] >= TOGETHER and not (alike and shares[0] >= TOGETHER)
    if not found:
        return None
    red, green, blue = (round(float(x)) for x in np.median(values[seeds[zones.labels]], axis=0))
    plate = _plate(rgb, zones, values, ground)
    return Plate(plate, (red, green, blue), f"{ground.sum()} zones with straight edges")


def _outermost(
    ring: Bool[np.ndarray, "height width"], shape: tuple[int, ...]
) -> Bool[np.ndarray, "rows columns"]:
    """Return the outermost cells of a border, which drawn frames do not reach."""
    cells = cv2.resize(ring.view(np.uint8), shape[::-1], interpolation=cv2.INTER_NEAREST)
    x, y, width, height = cv2.boundingRect(cells)
    edge = np.zeros(shape, dtype=bool)
    edge[y : y + height, x : x + width] = True
    edge[y + 1 : y + height - 1, x + 1 : x + width - 1] = False
    return edge


def _of_one_color(
    zones: Zones,
    small: UInt8[np.ndarray, "rows columns 3"],
    at_border: Bool[np.ndarray, "rows columns"],
) -> list[list[int]]:
    """Return the zones that take enough of the border, those of one colour together, and patches.

    Figures part a zone into several, of which some do not reach the border.
    """
    shares = np.bincount(zones.labels[at_border], minlength=zones.count + 1) / at_border.sum()
    numbers = np.flatnonzero((shares > 0) | (zones.areas >= LEAST_PATCH * zones.labels.size))
    numbers = numbers[numbers > 0][np.argsort(-shares[numbers[numbers > 0]], kind="stable")]
    groups: list[list[int]] = []
    colors: list[np.ndarray] = []
    for number in numbers.tolist():
        color = np.median(small[zones.labels == number], axis=0)
        same = [k for k, other in enumerate(colors) if np.abs(other - color).max() < CLOSE]
        if same:
            groups[same[0]].append(number)
        elif shares[number] > 0:
            groups.append([number])
            colors.append(color)
    return [group for group in groups if shares[group].sum() >= LEAST_ZONE]


def _laid(
    rgb: UInt8[np.ndarray, "height width 3"],
    masks: list[Bool[np.ndarray, "height width"]],
    fields: list[Field],
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the nearest zone's colours; the sheet's own, clipped to the zones', at steps."""
    box = (0, 0, rgb.shape[1], rgb.shape[0])
    numbers = np.zeros(rgb.shape[:2], dtype=np.int32)
    for k, mask in enumerate(masks):
        numbers[mask] = k + 1
    zone = from_nearest(numbers, numbers > 0)
    plate = np.zeros_like(rgb)
    low, high = np.full_like(rgb, 255), np.zeros_like(rgb)
    met = np.zeros(rgb.shape[:2], dtype=np.uint8)
    for k, (mask, field) in enumerate(zip(masks, fields, strict=True)):
        colors = field.colors(box)
        plate = np.where((zone == k + 1)[..., None], colors, plate)
        near = dilate(mask, STEP_PX)
        met += near
        low = np.where(near[..., None], np.minimum(low, colors), low)
        high = np.where(near[..., None], np.maximum(high, colors), high)
    between = np.clip(rgb, low, np.maximum(low, high))
    return np.where((met >= 2)[..., None], between, plate)


def _values(
    zones: Zones, small: UInt8[np.ndarray, "rows columns 3"]
) -> tuple[UInt8[np.ndarray, "rows columns 3"], Bool[np.ndarray, " zones"]]:
    """Return the zones' colours without noise, beyond them the nearest zone's; which are flat."""
    values = zones.colors(small).round().astype(np.uint8)[zones.labels]
    away = cv2.absdiff(small, values).max(axis=2)
    close = np.bincount(zones.labels[away <= CLOSE], minlength=zones.count + 1)
    large = zones.areas >= LEAST_PATCH * zones.labels.size
    sloping = large & (close < TOGETHER * zones.areas)
    sloping[0] = False
    for number in np.flatnonzero(sloping):
        whole = zones.labels == number
        values[whole] = fit_zone(small, whole).colors((0, 0, *small.shape[1::-1]))[whole]
    return from_nearest(values, zones.labels > 0), close >= FLAT * zones.areas


def _distances(
    zones: Zones, values: UInt8[np.ndarray, "rows columns 3"]
) -> Float[np.ndarray, "zones zones"]:
    """Return how far apart the zones' colours are, in levels; inf of what is no zone."""
    colors = zones.colors(values)
    away = np.abs(colors[:, None] - colors).max(axis=2)
    away[0], away[:, 0] = np.inf, np.inf
    return away


def _may_be_backdrop(
    at_border: Bool[np.ndarray, " zones"], away: Float[np.ndarray, "zones zones"], zones: Zones
) -> Bool[np.ndarray, " zones"]:
    """Return the zones that reach the border or far across, and those in about such a colour."""
    reaching = at_border | (zones.sizes_wh[:, 0] >= WIDE * zones.labels.shape[1])
    return np.asarray((away[:, reaching] <= SHADE).any(axis=1))


def _joined(
    seeds: Bool[np.ndarray, " zones"],
    possible: Bool[np.ndarray, " zones"],
    meetings: Meetings,
    zones: Zones,
) -> Bool[np.ndarray, " zones"]:
    """Return the zones that meet the seeds, or each other, in straight steps.

    Patches of colour that lie on the backdrop are not of it.
    """
    ground, least = seeds, LEAST_MEETING * min(zones.labels.shape)
    outline = meetings.length.sum(axis=1)
    patch = (zones.areas >= SWATCH * zones.sizes_wh.prod(axis=1)) & ~zones.are_lines
    patch &= zones.areas < LEAST_PATCH * zones.labels.size
    share = np.where(zones.are_thin & ~zones.are_lines, ALL_ALONG, ON_EDGES)
    while True:
        length = meetings.length[:, ground].sum(axis=1)
        straight = meetings.straight[:, ground].sum(axis=1)
        joined = (straight >= least) & (straight >= share * length) & possible & ~ground
        joined &= ~(patch & (length >= ALL_ROUND * outline))
        if not joined.any():
            return ground
        ground = ground | joined


def _panels(
    candidates: Bool[np.ndarray, " zones"], seeds: Bool[np.ndarray, " zones"], zones: Zones
) -> Bool[np.ndarray, " zones"]:
    """Return the zones, of those, that are panels on which figures stand.

    Args:
        candidates: zones that meet the page, or each other, in straight steps.
        seeds: the zones of the page.
        zones: all of them.
    """
    panels = np.zeros_like(candidates)
    things = parts(~seeds[zones.grown])
    of_panel = candidates[zones.grown]
    for number in np.unique(things[of_panel]):
        thing = things == number
        own = thing & of_panel
        if _is_panel(own, thing & ~own, zones.reach):
            panels[np.unique(zones.grown[own])] = True
    return panels


def _is_panel(
    own: Bool[np.ndarray, "rows columns"], drawn: Bool[np.ndarray, "rows columns"], reach: int
) -> bool:
    """Return whether zones show a rectangle within which most of what is drawn on it stands."""
    x, y, width, height = cv2.boundingRect(own.view(np.uint8))
    window = slice(y, y + height), slice(x, x + width)
    if width * height < LEAST_PANEL * own.size or own[window].mean() < SHOWN:
        return False
    across = width >= own.shape[1] - 2 * reach
    if not across and np.count_nonzero(drawn[window]) < WITHIN * np.count_nonzero(drawn):
        return False
    for turns in range(4):
        if _side(np.rot90(own[window], turns), np.rot90(drawn[window], turns)) < LEAST_SIDE:
            return False
    on_it = np.ascontiguousarray(drawn[window]).view(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(on_it, connectivity=8)
    return int(stats[1:, cv2.CC_STAT_HEIGHT].max(initial=0)) >= STANDING * height


def _side(
    panel: Bool[np.ndarray, "rows columns"], drawn: Bool[np.ndarray, "rows columns"]
) -> float:
    """Return the share of a panel's upper side that shows, without what is drawn over it."""
    first = panel.argmax(axis=0)[panel.any(axis=0)]
    near = np.convolve(np.bincount(first, minlength=3), np.ones(3, int), "same")  # by hand
    free = panel.shape[1] - np.count_nonzero(drawn[near.argmax()])
    return float(near.max() / max(free, 1))


def _plate(
    rgb: UInt8[np.ndarray, "height width 3"],
    zones: Zones,
    values: UInt8[np.ndarray, "rows columns 3"],
    ground: Bool[np.ndarray, " zones"],
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the colours of a ground of zones; the sheet's own, clipped to the zones', at steps."""
    size_wh = rgb.shape[1], rgb.shape[0]
    mask = dilate(zones.mask(np.flatnonzero(ground).tolist(), size_wh), STEP_PX)
    near = from_nearest(values, ground[zones.labels])
    colors = cv2.resize(near, size_wh, interpolation=cv2.INTER_NEAREST)
    known = mask & (cv2.absdiff(rgb, colors).max(axis=2) <= CLOSE)
    lines = zones.mask(np.flatnonzero(ground & zones.are_lines).tolist(), size_wh)
    broad = known & ~dilate(lines, STEP_PX)  # a line's colour does not spread into figures
    plate = np.where(known[..., None], colors, from_nearest(colors, broad))
    reach = np.ones((2 * STEP_PX + 1,) * 2, np.uint8)
    low = cv2.erode(np.where(known[..., None], plate, np.uint8(255)), reach)
    high = cv2.dilate(np.where(known[..., None], plate, np.uint8(0)), reach)
    met = cv2.subtract(high, low).max(axis=2) > CLOSE
    between = np.clip(rgb, low, np.maximum(low, high))
    return np.where(met[..., None], between, plate)
