"""Blend a new view from the flanking drawings, by labels that they vote on.

Every place of the surface is looked up in the two drawings beside the view, each shifted towards
the other by its share of how far they lie apart (`paint_flow`). Their labels and the field's vote;
the colour is the mean of the candidates that carry the label which won, so shades survive and
nothing is mixed across labels. What neither shows is taken from a third drawing, then the field.

Source: Debevec, Taylor and Malik 1996 (view-dependent texture mapping); Eisemann et al. 2008
("Floating textures").
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.camera import Camera
from toonset.nerf.hull.mannequin_shape import FINER, ShapeView
from toonset.nerf.look.drawings import (
    CRUMB,
    SQUARE,
    STEP,
    Drawings,
    Texture,
    crisp_depth,
    filled,
    look_up,
    sample_picture,
)
from toonset.nerf.look.outline import CRUMB_PX, crisp_outline
from toonset.nerf.look.paint_flow import NEIGHBOURS
from toonset.nerf.look.shade import smoothed
from toonset.nerf.look.step_lines import draw_steps
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.recolor import tones_of
from toonset.raster import nearest, sized_parts

SOLID = 0.5  # opacity from which a pixel shows the surface
BORDER = 0.7  # opacity at an outline between bent drawings, whose hull is a little too large
HOLE_PX = 80  # area, as CRUMB_PX: where bent drawings disagree, hulls of capes are torn
OPAQUE = 0.6  # opacity from which a field's colour is its own
FIELD_VOTE = 0.25  # beside 1 of the drawings together
# Of two drawings that were not made to agree: more votes of the nearer, and the power of shares in
# the colour of one label, or eyes without a paint of their own are there twice
LEAD, SHARP = 0.5, 6
SOFT = 0.8 / 260  # sigma over the figure's height, over which votes are shared
FEATHER = 4.0 / 260  # of the height: so near to outlines and steps drawings show different things
LEAST_TRUST = 0.1
SIDE_VOTE, OWN_VOTE = 0.5, 0.3  # of a third drawing, of the field: only where nothing better is
SLIVER = 0.03  # of the height: places so near to paint have it, too
STRAY = 4e-4  # of the squared height: smaller patches are no drawing's
SIDE = 1.4  # radians: a drawing farther off the view shows too little of it
THIRDS = 2  # further drawings that are asked
ROOM = 4  # pixels round what is blended
SAME = 1e-9  # radians: seen from one side
# Radians off a drawing's own camera, in which the view becomes the drawing; where the others were
# made to agree and it was bent or moved for that, the less, the steadier
OWN, OWN_BENT = 0.12, 0.04
DRAWN, MIRRORED, GUESSED = 0, 1, 2  # where a pixel's paint comes from
SOURCES = ("drawn", "mirrored", "guessed")
Box = tuple[slice, slice]  # rows and columns


@dataclass(frozen=True, eq=False)
class Geometry:
    """Geometry of the field as a view sees it.

    Attributes:
        camera: of the view.
        alpha: (height, width) opacity in [0, 1].
        depth: (height, width) past the camera's target, nan where nothing is seen.
        rgb: (height, width, 3) premultiplied colour in [0, 1].
        shares: (height, width, colors) of every palette colour; None without palette.
    """

    camera: Camera
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    rgb: Float[np.ndarray, "height width 3"]
    shares: Float[np.ndarray, "height width colors"] | None

    def crop(self, rows: slice, columns: slice) -> Geometry:
        """Return a part of the view."""
        at = (rows, columns)
        size = (columns.stop - columns.start, rows.stop - rows.start)
        return Geometry(
            self.camera.moved((columns.start, rows.start), size),
            self.alpha[at],
            self.depth[at],
            self.rgb[at],
            None if self.shares is None else self.shares[at],
        )


@dataclass(frozen=True, eq=False)
class DrawnView:
    """A view in the drawn look.

    Attributes:
        rgb: (height, width, 3) premultiplied colour in [0, 1], lines included.
        alpha: (height, width) coverage in [0, 1].
        ink: (height, width) share of every pixel that lines cover.
        labels: (height, width) of `Drawings.paints`.
        paint: (height, width, 3) straight colour under the lines, in [0, 1].
        source: (height, width) of a pixel's paint: DRAWN; MIRRORED, where only the mirror image of
            a drawing shows the place; GUESSED, which is the field's colour.
    """

    rgb: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]
    ink: Float[np.ndarray, "height width"]
    labels: UInt8[np.ndarray, "height width"]
    paint: Float[np.ndarray, "height width 3"]
    source: UInt8[np.ndarray, "height width"]

    @property
    def by_field(self) -> float:
        """Return the share of the figure's pixels that no drawing shows."""
        return self.share(GUESSED)

    def share(self, source: int) -> float:
        """Return the share of the figure's pixels whose paint comes from a source."""
        solid = self.alpha >= SOLID
        return float((solid & (self.source == source)).sum() / max(solid.sum(), 1))

    def palette_labels(self, colors: int) -> UInt8[np.ndarray, "height width"]:
        """Return the labels of a palette's colours; 255 beside the figure and on other ink."""
        shown = (self.alpha >= SOLID) & (self.labels < colors)
        return np.where(shown, self.labels, UNLABELLED).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Colour and label of every pixel by one source."""

    color: Float[np.ndarray, "h w 3"]
    label: UInt8[np.ndarray, "h w"]
    weight: Float[np.ndarray, "h w"]


def flanking(cameras: list[Camera], camera: Camera) -> tuple[int, int, float]:
    """Return the two drawings beside a view, and the first one's share.

    The first is the nearest, the second the nearest of those towards which the view lies from it;
    shares are linear in the angle along the arc between them. Where the view lies towards none,
    both are the same.
    """
    forward = camera.rotation[2]
    theirs = np.stack([own.rotation[2] for own in cameras])
    angles = np.arccos(np.clip(theirs @ forward, -1, 1))
    first = int(angles.argmin())
    start = theirs[first]
    turns = theirs - (theirs @ start)[:, None] * start
    whole = np.arctan2(np.linalg.norm(turns, axis=1), theirs @ start)
    turns /= np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12)
    along = np.arctan2(turns @ forward, start @ forward)
    towards = (along > SAME) & (whole > SAME) & (whole < NEIGHBOURS)
    if not towards.any():
        return first, first, 1.0
    second = int(np.where(towards, angles, np.inf).argmin())
    return first, second, 1 - min(1.0, float(along[second] / whole[second]))


def blend_view(drawings: Drawings, view: Geometry) -> DrawnView:
    """Blend a view of the field from its drawings, in the colours that they show."""
    height, width = view.alpha.shape
    result = DrawnView(
        np.zeros((height, width, 3), np.float32),
        np.zeros((height, width), np.float32),
        np.zeros((height, width), np.float32),
        np.zeros((height, width), np.uint8),
        np.zeros((height, width, 3), np.float32),
        np.zeros((height, width), np.uint8),
    )
    fitting, border = drawings.fitting(view.camera.scale), _border(drawings, view)
    shape = drawings.shape
    box = _box(view.alpha > 0) if shape is None else shape.box(view.camera)
    own, share = _own_part(fitting, view.camera)
    if share > 0:  # a drawing may show more than the surface has
        box = _joined(box, _own_box(fitting, own, view.camera))
    if box is None:
        return result
    part = _drawn(fitting, view.crop(*box), border)
    for name in ("rgb", "alpha", "ink", "labels", "paint", "source"):
        getattr(result, name)[box] = getattr(part, name)
    return result


def _own_part(drawings: Drawings, camera: Camera) -> tuple[int, np.float32]:
    """Return the drawing nearest to a view, and how far the view is that drawing itself, 0 to 1."""
    forward = np.stack([view.camera.rotation[2] for view in drawings.views])
    turns = np.arccos(np.clip(forward @ camera.rotation[2], -1, 1))
    nearest_one = int(turns.argmin())
    reach = OWN if drawings.views[nearest_one].original is None else OWN_BENT
    return nearest_one, np.float32(_eased(max(0.0, 1 - float(turns[nearest_one]) / reach)))


def _own_box(drawings: Drawings, number: int, camera: Camera) -> Box | None:
    """Return the rows and columns of a view in which a drawing near it shows something."""
    own = drawings.views[number].as_drawn
    found = _box(own.rgba[..., 3] > 0, 0)
    assert found is not None
    rows, columns = ((side.start, side.stop) for side in found)
    near, far = drawings.depths
    slack = STEP * drawings.height
    at = np.array([(u, v, z) for u in columns for v in rows for z in (near - slack, far + slack)])
    pixels, _, _ = camera.project(own.camera.unproject(at[:, :2], at[:, 2]))
    width, height = camera.size_wh
    low, high = np.floor(pixels.min(axis=0)) - ROOM, np.ceil(pixels.max(axis=0)) + ROOM
    left, right = np.clip([low[0], high[0]], 0, width).astype(int).tolist()
    top, bottom = np.clip([low[1], high[1]], 0, height).astype(int).tolist()
    return (slice(top, bottom), slice(left, right)) if top < bottom and left < right else None


def _joined(box: Box | None, other: Box | None) -> Box | None:
    """Return the least box around two."""
    if box is None or other is None:
        return box or other
    rows, columns = (
        slice(min(a.start, b.start), max(a.stop, b.stop)) for a, b in zip(box, other, strict=True)
    )
    return rows, columns


def _box(mask: Bool[np.ndarray, "height width"], room: int = ROOM) -> Box | None:
    if not mask.any():
        return None
    sides = []
    for axis, size in ((1, mask.shape[0]), (0, mask.shape[1])):
        found = np.flatnonzero(mask.any(axis=axis))
        sides.append(slice(max(0, int(found[0]) - room), min(size, int(found[-1]) + 1 + room)))
    return sides[0], sides[1]


def _drawn(drawings: Drawings, view: Geometry, border: float) -> DrawnView:
    camera, own_color = view.camera, _straight(view)
    sight = None
    if drawings.shape is not None:
        sight = drawings.shape.seen(camera, normals=drawings.shade is not None)
        view = replace(view, alpha=sight.alpha, depth=sight.depth)
    points = camera.unproject(camera.pixel_grid(), crisp_depth(view.depth))
    figure_px = drawings.height * camera.scale
    cameras = [texture.camera for texture in drawings.textures]
    first, second, share = flanking(cameras, camera)
    candidates, covered, by_drawing = _candidates(
        drawings, view, points, own_color, (first, second, share)
    )
    color, labels = _voted(
        candidates, view, len(drawings.paints), figure_px, SHARP if drawings.apart else 1
    )
    if sight is not None:
        source, covered = _sliver_sources(
            covered, view.depth, STEP * drawings.height, SLIVER * figure_px
        )
        color, labels = color[tuple(source)], labels[tuple(source)]
        by_drawing = by_drawing[tuple(source)]
    source = np.where(by_drawing, DRAWN, np.where(covered, MIRRORED, GUESSED)).astype(np.uint8)
    solid = view.alpha > SOLID
    if solid.any():
        at = nearest(solid)
        color, labels = color[at], labels[at]
    if sight is not None and drawings.shade is not None:
        color = color * drawings.shade.tone(smoothed(sight.normal, figure_px), FINER)
    scale = camera.scale / cameras[first].scale
    own, part = _own_part(drawings, camera)
    whole = _as_drawn(drawings.textures[own], points)
    rgb, alpha, ink = _inked(drawings, view, color, border, scale, sight, whole, part)
    if part == 1:
        source[...] = MIRRORED if drawings.views[own].mirrored else DRAWN
    return DrawnView(rgb, alpha, ink, labels, color, source)


def _as_drawn(texture: Texture, points: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 4"]:
    """Return a drawing as it is on the sheet where surface points lie in it, premultiplied."""
    pixels, _, _ = texture.drawn_by.project(points)
    x, y = (np.nan_to_num(pixels[..., k] - 0.5, nan=-1e4).astype(np.float32) for k in (0, 1))
    x, y = np.round(x, 3), np.round(y, 3)  # at the drawing's own camera its very pixels
    return np.asarray(cv2.remap(texture.drawn, x, y, cv2.INTER_CUBIC).clip(0, 1))


def _inked(
    drawings: Drawings,
    view: Geometry,
    paint: Float[np.ndarray, "h w 3"],
    border: float,
    scale: float,
    sight: ShapeView | None,
    whole: Float[np.ndarray, "h w 4"],
    part: np.float32,
) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """Return colour, coverage and ink of paint with its lines.

    Args:
        drawings: whose lines.
        view: what is seen of the field.
        paint: straight colour.
        border: opacity at the outline.
        scale: of the view over the nearest drawing's.
        sight: what the view shows of the mannequin's shape, if the field is one.
        whole: the nearest drawing as it is on the sheet, premultiplied, moved to the view.
        part: of it in the result.
    """
    pen = drawings.pen
    line_px = pen.width_px * scale if pen else 0.0
    soft = view.alpha + part * (whole[..., 3] - view.alpha)
    border += float(part) * (SOLID - border)
    hole_px = HOLE_PX if drawings.bent and sight is None else CRUMB_PX
    figure_px = drawings.height * view.camera.scale
    alpha, ink = crisp_outline(soft, border, line_px, figure_px, hole_px)
    if sight is not None:
        ink = np.maximum(ink, np.minimum(_inner_lines(drawings, sight, scale), alpha))
    drawn_with = np.array(pen.rgb if pen else (0, 0, 0), np.float32) / np.float32(255)
    rgb = paint * (alpha - ink)[..., None] + ink[..., None] * drawn_with
    if pen == drawings.outline:  # the drawing's own line, too
        drawn = np.minimum(whole[..., :3], whole[..., 3:])
        mixed = part * whole[..., 3:] * alpha[..., None]
        rgb = rgb * (1 - part * whole[..., 3:]) + mixed * drawn / np.maximum(whole[..., 3:], 1e-6)
        last = max(np.float32(0), 2 * part - 1)  # what the surface lacks is there as a whole or not
        rgb, alpha = rgb + last * (drawn - rgb), alpha + last * (whole[..., 3] - alpha)
    return rgb, alpha, ink


def _inner_lines(drawings: Drawings, sight: ShapeView, scale: float) -> Float[np.ndarray, "h w"]:
    """Return how far lines cover every pixel where one part of the figure hides another."""
    pen, outline, style = drawings.pen, drawings.outline, drawings.steps
    if pen is None or outline is None or style is None:
        return np.zeros(sight.alpha.shape, np.float32)
    wider = pen.width_px / max(outline.width_px, 1e-6)
    return draw_steps(sight.fine, style, drawings.height, FINER, scale * wider)


def _border(drawings: Drawings, view: Geometry) -> float:
    """Return the opacity at an outline; in small views opacity is soft by their own pixels."""
    if not drawings.bent or drawings.shape is not None:
        return SOLID
    finer = view.camera.scale / min(one.camera.scale for one in drawings.views)
    return SOLID + min(1.0, finer) * (BORDER - SOLID)


def _eased(part: float) -> float:
    return part * part * (3 - 2 * part)


def _candidates(
    drawings: Drawings,
    view: Geometry,
    points: Float[np.ndarray, "h w 3"],
    own_color: Float[np.ndarray, "h w 3"],
    between: tuple[int, int, float],
) -> tuple[list[_Candidate], Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return candidates, the pixels that a drawing shows, and those that no mirror image has to."""
    first, second, share = between
    there = np.isfinite(view.depth)
    textures = drawings.textures
    slack, least = STEP * drawings.height, CRUMB * (drawings.height * view.camera.scale) ** 2
    flow = None
    found = drawings.flow(first, second) if first != second else None
    if found is not None:
        flow = np.float32(found[1]) * found[0].at(points)
    covered, candidates = np.zeros(there.shape, dtype=bool), []
    by_drawing = covered.copy()
    lead = LEAD if drawings.apart else 0.0
    sides = ((first, -(1 - share), share + lead), (second, share, 1 - share))
    for number, part, weight in sides:
        if weight == 0:
            continue
        texture = textures[number]
        seen = look_up(texture, points, slack, least)
        mask = seen.mask & there
        places = seen.moved(flow, part)
        edge_px = sample_picture(texture.to_edge, places, cv2.INTER_LINEAR)
        feather_px = FEATHER * drawings.height * texture.camera.scale
        trust = _trust(edge_px, feather_px) * _feathered(mask)
        candidates.append(_candidate(texture, places, np.float32(weight) * trust))
        covered |= mask
        by_drawing |= mask & (not drawings.views[number].mirrored)
    for number in _others(drawings, view.camera, (first, second)):
        if (covered | ~there).all():
            break
        seen = look_up(textures[number], points, slack, least)
        gap = seen.mask & there & ~covered
        if gap.any():
            weight = SIDE_VOTE * gap.astype(np.float32)
            candidates.append(_candidate(textures[number], (seen.x, seen.y), weight))
            covered |= gap
            by_drawing |= gap & (not drawings.views[number].mirrored)
    candidates.append(_of_field(own_color, drawings, covered | ~there))
    return candidates, covered, by_drawing


def _others(drawings: Drawings, camera: Camera, used: tuple[int, int]) -> list[int]:
    forward = np.stack([view.camera.rotation[2] for view in drawings.views])
    angles = np.arccos(np.clip(forward @ camera.rotation[2], -1, 1))
    order = [int(i) for i in np.argsort(angles) if i not in used and angles[i] < SIDE]
    return order[:THIRDS]


def _candidate(
    texture: Texture, places: tuple[np.ndarray, np.ndarray], weight: Float[np.ndarray, "h w"]
) -> _Candidate:
    color = sample_picture(texture.paint, places, cv2.INTER_CUBIC).clip(0, 1)
    return _Candidate(color, sample_picture(texture.labels, places, cv2.INTER_NEAREST), weight)


def _straight(view: Geometry) -> Float[np.ndarray, "h w 3"]:
    """Return the field's colours, beside what it shows those of the nearest that is opaque."""
    color = (view.rgb / np.maximum(view.alpha, 0.2)[..., None]).clip(0, 1).astype(np.float32)
    return color[nearest(view.alpha > OPAQUE)] if (view.alpha > OPAQUE).any() else color


def _of_field(
    color: Float[np.ndarray, "h w 3"], drawings: Drawings, covered: Bool[np.ndarray, "h w"]
) -> _Candidate:
    paints, shadow = drawings.paints, drawings.painted_shadow
    tones, new = (
        tones_of(one, shadow)[: len(one) if shadow is None else None] / np.float32(255)
        for one in (paints, drawings.new_paints)
    )
    tone = np.zeros(covered.shape, dtype=np.intp)  # read only where no drawing shows anything
    gaps = cv2.dilate((~covered).astype(np.uint8), SQUARE) > 0
    tone[gaps] = ((color[gaps][:, None] - tones) ** 2).sum(axis=-1).argmin(axis=-1)
    label = (tone % len(paints)).astype(np.uint8)
    if drawings.repaint is not None:
        color = (color + cv2.blur((new - tones)[tone], (3, 3))).clip(0, 1)
    return _Candidate(color, label, np.where(covered, 0, OWN_VOTE).astype(np.float32))


def _trust(edge_px: Float[np.ndarray, "h w"], feather_px: float) -> Float[np.ndarray, "h w"]:
    return 1 - (1 - LEAST_TRUST) * np.exp(-((edge_px / feather_px) ** 2))


def _feathered(mask: Bool[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Return a mask that fades inwards, so that a drawing ends without a seam."""
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    return ((2 * soft - 1).clip(0, 1) + 0.02) * mask


def _voted(
    candidates: list[_Candidate], view: Geometry, paints: int, figure_px: float, sharp: int
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return the colour and the label that candidates agree on."""
    votes = np.zeros((*view.alpha.shape, paints), np.float32)
    if view.shares is not None:
        votes[..., : view.shares.shape[-1]] = FIELD_VOTE * view.shares
    rows, columns = (np.arange(size) for size in view.alpha.shape)
    for one in candidates:
        votes[rows[:, None], columns, one.label] += one.weight
    votes = cv2.GaussianBlur(votes, (0, 0), SOFT * figure_px).reshape(votes.shape)
    winner = votes.argmax(axis=-1).astype(np.uint8)
    weights = [one.weight**sharp * (one.label == winner) for one in candidates]
    total = np.sum(weights, axis=0)
    for one, weight in zip(candidates, weights, strict=True):  # none of the label: all of them
        weight += 1e-4 * one.weight * (total < 1e-4)
    total = np.maximum(np.sum(weights, axis=0), 1e-9)
    color = np.zeros((*total.shape, 3), np.float32)
    for one, weight in zip(candidates, weights, strict=True):
        color += (weight / total)[..., None] * one.color
    kept = ~_stray(winner, candidates, paints, STRAY * figure_px**2) & (view.alpha > SOLID)
    if kept.any():
        at = nearest(kept)
        return color[at], winner[at]
    return color, winner


def _sliver_sources(
    covered: Bool[np.ndarray, "h w"], depth: Float[np.ndarray, "h w"], apart: float, reach_px: float
) -> tuple[Int[np.ndarray, "2 h w"], Bool[np.ndarray, "h w"]]:
    """Return from where every pixel takes its paint, and which have that of a drawing then.

    Slivers that no drawing shows go on with the paint beside them, if it is of the same surface.
    """
    here = np.indices(covered.shape)
    if covered.all() or not covered.any():
        return here, covered
    there, deep = np.stack(nearest(covered)), filled(depth)
    near = np.hypot(*(there - here)) <= reach_px
    near &= np.abs(deep[tuple(there)] - deep) <= apart
    return np.where(near, there, here), near


def _stray(
    winner: UInt8[np.ndarray, "h w"], candidates: list[_Candidate], paints: int, least_px: float
) -> Bool[np.ndarray, "h w"]:
    """Return small patches of one label that no single drawing shows as such."""
    drop = np.zeros(winner.shape, dtype=bool)
    for label in range(paints):
        part, areas = sized_parts(winner == label)
        small = areas < least_px
        small[0] = False
        if not small.any():
            continue
        places = np.flatnonzero(np.take(small, part))
        own = part.ravel()[places]
        known = np.zeros(len(areas), dtype=bool)
        for one in candidates[:2]:
            other, theirs = sized_parts(one.label == label)
            alike = (theirs <= 3 * least_px)[other.ravel()[places]]
            alike &= one.label.ravel()[places] == label
            known |= np.bincount(own, alike, len(areas)) > SOLID * areas
        drop.ravel()[places] = ~known[own]
    return drop
