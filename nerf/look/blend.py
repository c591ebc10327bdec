"""Draw a new view from the drawings: their paint, carried over the surface in whole patches.

Every place of the surface, smoothed (`surface`), is looked up in the two drawings beside the view,
each shifted towards the other by its share of how far they lie apart (`paint_flow`); what neither
shows is looked up in further ones. Every pixel shows one of them (`choose`), and what none shows
goes on with the paint beside it. The outline lies between the drawings' own (`silhouette`).

Source: Debevec, Taylor and Malik 1996 (view-dependent texture mapping); Eisemann et al. 2008
("Floating textures").
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.camera import Camera
from toonset.nerf.hull.mannequin_shape import FINER, Shape, ShapeView
from toonset.nerf.look.borders import Unlined, missing_lines, missing_steps, settled
from toonset.nerf.look.choose import OTHER, Look, choose, filled_from, joints, mixed, shared_groups
from toonset.nerf.look.drawings import (
    CRUMB,
    STEP,
    Drawings,
    Texture,
    crisp_depth,
    look_up,
    places_in,
    sample_picture,
)
from toonset.nerf.look.features import lines_of
from toonset.nerf.look.outline import crisp_outline, inked_outline, without_noise
from toonset.nerf.look.paint_flow import NEIGHBOURS
from toonset.nerf.look.shade import smoothed
from toonset.nerf.look.silhouette import between_outlines, smooth_outline
from toonset.nerf.look.stamps import NEARER, Stamp, stamped, stamps, torn
from toonset.nerf.look.step_lines import draw_steps
from toonset.nerf.look.surface import smooth_surface
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import dilate, sized_parts

SOLID = 0.5  # opacity from which a pixel shows the surface
BORDER = 0.7  # opacity at an outline between bent drawings, whose hull is a little too large
SIDE = 1.4  # radians: a drawing farther off the view shows too little of it
THIRDS = 2  # further drawings that are asked
ROOM = 0.03  # of the figure's height, round what is drawn
EDGE_PX = 4  # round a drawing: enlarging by cubic curves reaches two pixels
SAME = 1e-9  # radians: seen from one side
# Radians off a drawing's own camera, in which the view becomes the drawing; where the others were
# made to agree and it was bent or moved for that, the less, the steadier
OWN, OWN_BENT = 0.12, 0.04
# Of the height, and pixels, beside the nearest drawing: what lies farther from it is not shown
BEYOND, BESIDE_PX = 0.01, 2
AFLOAT = 0.25  # share of what floats beside a figure: so much of it has to in a drawing, too
LEGS = 0.1  # of the figure: what is larger stays, though nothing joins it
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
    """

    camera: Camera
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]

    @classmethod
    def of(cls, camera: Camera) -> Geometry:
        """Return what is seen where only the mannequin's shape is known: nothing."""
        size = camera.size_wh[::-1]
        return cls(camera, np.zeros(size, np.float32), np.full(size, np.nan, np.float32))

    def crop(self, rows: slice, columns: slice) -> Geometry:
        """Return a part of the view."""
        at = (rows, columns)
        size = (columns.stop - columns.start, rows.stop - rows.start)
        corner = (columns.start, rows.start)
        return Geometry(self.camera.moved(corner, size), self.alpha[at], self.depth[at])


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
            a drawing shows the place; GUESSED, which is the paint beside it; or, in a
            view of which no drawing shows anything, that of the nearest drawing behind it.
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
    shape, room = drawings.shape, int(np.ceil(ROOM * drawings.height * view.camera.scale)) + 1
    box = _box(view.alpha > 0, room) if shape is None else shape.box(view.camera)
    own, share = _own_part(fitting, view.camera)
    limbs = _limbs(fitting, view.camera)
    if limbs is not None:
        box = _joined(box, limbs.box(view.camera))
    if share > 0:  # a drawing may show more than the surface has
        box = _joined(box, _own_box(fitting, own, view.camera))
    if box is None:
        return result
    part = _drawn(fitting, view.crop(*box), border)
    for name in ("rgb", "alpha", "ink", "labels", "paint", "source"):
        getattr(result, name)[box] = getattr(part, name)
    return result


def _limbs(drawings: Drawings, camera: Camera) -> Shape | None:
    """Return what the drawing nearest to a view shows and the field lacks."""
    first, _, _ = flanking([one.camera for one in drawings.views], camera)
    return drawings.views[first].limbs


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
    low, high = np.floor(pixels.min(axis=0)) - EDGE_PX, np.ceil(pixels.max(axis=0)) + EDGE_PX
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


def _box(mask: Bool[np.ndarray, "height width"], room: int) -> Box | None:
    if not mask.any():
        return None
    sides = []
    for axis, size in ((1, mask.shape[0]), (0, mask.shape[1])):
        found = np.flatnonzero(mask.any(axis=axis))
        sides.append(slice(max(0, int(found[0]) - room), min(size, int(found[-1]) + 1 + room)))
    return sides[0], sides[1]


def _drawn(drawings: Drawings, view: Geometry, border: float) -> DrawnView:
    camera, figure_px = view.camera, drawings.height * view.camera.scale
    flank = flanking([texture.camera for texture in drawings.textures], camera)
    sight, limb = None, np.zeros(view.alpha.shape, dtype=bool)
    if drawings.shape is not None:
        sight = drawings.shape.seen(camera, normals=drawings.shade is not None)
        view = replace(view, alpha=sight.alpha, depth=sight.depth)
        depth = crisp_depth(view.depth)
    else:
        view, limb = _posed(drawings, flank[0], view)
        depth = smooth_surface(view.depth, drawings.height, figure_px)
    points = camera.unproject_grid(depth)
    numbers, looks = _looks(drawings, camera, points, flank)
    if limb.any():  # which no other drawing shows
        looks = [looks[0], *(replace(one, seen=one.seen & ~limb) for one in looks[1:])]
    own, part = _own_part(drawings, camera)
    whole = np.zeros((*depth.shape, 4), np.float32)
    if part > 0:
        whole = _as_drawn(drawings.textures[own], points)
    scale = looks[0].scale
    alpha, ink = _outlined(drawings, view, looks, border, sight, whole[..., 3], part)
    both = flank[0] != flank[1]
    shared = shared_groups(looks) if both and sight is None else []
    chosen, counts = choose(looks, alpha > 0, figure_px, shared)
    features: list[Stamp] = []
    if sight is None:
        solid = np.where(alpha > SOLID, chosen, -1)
        features, without = stamps(
            looks, both, camera, solid, counts, depth, drawings.height, shared
        )
        looks = [look.bare(those) for look, those in zip(looks, without, strict=True)]
    color, labels = mixed(looks, chosen, counts)
    shown = (chosen >= 0) & (alpha > 0)
    line = drawings.outline
    pen = None if line is None else (line.width_px * scale, line.rgb)
    kept = shown & ~torn(color, looks, np.where(shown, chosen, -1), shown, figure_px, pen)
    if not shown.any():  # as if the body were of glass
        color, labels = mixed(looks, np.zeros_like(chosen), counts)
    color, labels = _extended(kept, color, labels, pen)
    if sight is None:
        inside = alpha > 0
        meeting = joints(looks, np.where(kept, chosen, -1), inside)
        color, labels = settled(color, labels, meeting, inside, pen, figure_px)
    stepped = sight is None and drawings.steps_hold
    if line is not None and (stepped or len(drawings.lined_pairs)):
        unlined = _unlined(looks, np.where(kept, chosen, -1), alpha > SOLID, figure_px)
        cover = missing_lines(unlined, drawings.lined_pairs, line.width_px * scale)
        if stepped:
            hidden = missing_steps(unlined, depth, drawings.height, line.width_px * scale)
            cover = np.maximum(cover, hidden)
        label, rgb = drawings.ink(line)
        color = color + cover[..., None] * (rgb / np.float32(255) - color)
        labels = np.where(cover > SOLID, np.uint8(label), labels)
    color, labels = stamped(color, labels, looks, features, depth, NEARER * drawings.height)
    mirrored = np.array([drawings.views[number].mirrored for number in numbers])
    source = np.where(shown, np.where(mirrored[chosen], MIRRORED, DRAWN), GUESSED)
    if sight is not None and drawings.shade is not None:
        color = color * drawings.shade.tone(smoothed(sight.normal, figure_px), FINER)
    if sight is not None:
        ink = np.maximum(ink, np.minimum(_inner_lines(drawings, sight, scale), alpha))
    rgb, alpha = _with_lines(drawings, color, alpha, ink, whole, part)
    if part == 1:
        source = np.full(source.shape, MIRRORED if drawings.views[own].mirrored else DRAWN)
    return DrawnView(rgb, alpha, ink, labels, color, source.astype(np.uint8))


def _extended(
    kept: Bool[np.ndarray, "h w"],
    color: Float[np.ndarray, "h w 3"],
    labels: UInt8[np.ndarray, "h w"],
    pen: tuple[float, tuple[int, int, int]] | None,
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return paint that goes on beyond what is kept; lines do not."""
    paint = kept & ~lines_of(color, pen)
    if not paint.any():
        paint = kept
    beyond, beyond_labels = filled_from(paint, color, labels)
    return np.where(kept[..., None], color, beyond), np.where(kept, labels, beyond_labels)


def _unlined(
    looks: list[Look], chosen: Int[np.ndarray, "h w"], inside: Bool[np.ndarray, "h w"], px: float
) -> Unlined:
    """Return the paints that a view's drawings have there under their lines."""
    labels, lined = (np.zeros(chosen.shape, np.uint8) for _ in range(2))
    for number, look in enumerate(looks):
        here = (chosen == number).view(np.uint8)
        if here.any():
            places, own = (look.x, look.y), look.texture.unlined
            for whole, its in ((labels, own.labels), (lined, own.lined.view(np.uint8))):
                cv2.copyTo(sample_picture(its, places, cv2.INTER_NEAREST), here, whole)
    return Unlined(labels, lined > 0, inside & (chosen >= 0), px).extended(inside)


def _posed(
    drawings: Drawings, number: int, view: Geometry
) -> tuple[Geometry, Bool[np.ndarray, "h w"]]:
    """Return a view with its limbs as a drawing has them, and the pixels of those it lacked."""
    texture, limbs, camera = drawings.textures[number], drawings.views[number].limbs, view.camera
    there = np.isfinite(view.depth)
    if drawings.views[number].mirrored:
        return view, np.zeros(there.shape, dtype=bool)
    points = camera.unproject_grid(np.where(there, view.depth, 0))
    places, _, _ = places_in(texture.camera, points)
    most = BEYOND * texture.figure_px + BESIDE_PX
    off = there & (sample_picture(texture.beyond, places, cv2.INTER_LINEAR) > most)
    if off.any():
        off = dilate(off, 2) & (off | ~there)
        alpha, depth = np.where(off, 0, view.alpha), np.where(off, np.nan, view.depth)
        view = replace(view, alpha=alpha, depth=depth)
    if limbs is None:
        return view, np.zeros(there.shape, dtype=bool)
    own = limbs.seen(camera)
    added = np.isfinite(own.depth) & ~(view.depth < own.depth)
    alpha, depth = np.maximum(view.alpha, own.alpha), np.fmin(view.depth, own.depth)
    return replace(view, alpha=alpha, depth=depth), added


def _looks(
    drawings: Drawings,
    camera: Camera,
    points: Float[np.ndarray, "h w 3"],
    flank: tuple[int, int, float],
) -> tuple[list[int], list[Look]]:
    """Return the drawings that a view asks, the nearest first, and how they see its places."""
    first, second, share = flank
    figure_px = drawings.height * camera.scale
    found = drawings.flow(first, second) if first != second else None
    flow = None if found is None else np.float32(found[1]) * found[0].at(points)
    sides = [(first, -(1 - share), share)]
    if second != first:
        sides.append((second, share, 1 - share))
    forward = camera.rotation[2]
    for number in _others(drawings, camera, (first, second)):
        facing = float(drawings.textures[number].camera.rotation[2] @ forward)
        sides.append((number, 0.0, OTHER * facing))
    looks = []
    for number, part, weight in sides:
        texture = drawings.textures[number]
        slack, least_px = STEP * drawings.height, CRUMB * figure_px**2
        seen = look_up(texture, points, slack, least_px, faces=drawings.shape is None)
        x, y = seen.moved(flow, part)
        scale = camera.scale / texture.camera.scale
        looks.append(Look(texture, x, y, seen.mask, weight, scale))
    return [number for number, _, _ in sides], looks


def _others(drawings: Drawings, camera: Camera, used: tuple[int, int]) -> list[int]:
    forward = np.stack([view.camera.rotation[2] for view in drawings.views])
    angles = np.arccos(np.clip(forward @ camera.rotation[2], -1, 1))
    order = [int(i) for i in np.argsort(angles) if i not in used and angles[i] < SIDE]
    return order[:THIRDS]


def _outlined(
    drawings: Drawings,
    view: Geometry,
    looks: list[Look],
    border: float,
    sight: ShapeView | None,
    whole: Float[np.ndarray, "h w"],
    part: np.float32,
) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """Return coverage and ink of a view's outline.

    Args:
        drawings: whose line it is.
        view: what is seen of the field.
        looks: the drawings, those that flank the view first.
        border: opacity at the outline.
        sight: what the view shows of the mannequin's shape, if the field is one.
        whole: coverage of the nearest drawing as it is on the sheet, moved to the view.
        part: of it in the result.
    """
    figure_px = drawings.height * view.camera.scale
    line_px = drawings.pen.width_px * looks[0].scale if drawings.pen else 0.0
    if sight is not None:
        soft = view.alpha + part * (whole - view.alpha)
        return crisp_outline(soft, border + float(part) * (SOLID - border), line_px, figure_px)
    cover = without_noise(view.alpha, border, figure_px)
    rims = []
    for look in looks[:2] if len(looks) > 1 and looks[0].share < 1 else looks[:1]:
        facing = float(look.texture.camera.rotation[2] @ view.camera.rotation[2])
        angle = float(np.arccos(np.clip(facing, -1, 1)))
        rims.append((look.texture.rim.at(look.x, look.y), look.share, angle))
    inside = between_outlines(smooth_outline(cover, figure_px), rims, figure_px)
    inside = np.where(_afloat(inside > 0, looks), -ROOM, inside).astype(np.float32)
    return inked_outline(inside * figure_px, line_px, figure_px)


def _afloat(solid: Bool[np.ndarray, "h w"], looks: list[Look]) -> Bool[np.ndarray, "h w"]:
    """Return the parts of a figure that float beside it, though no drawing shows them so."""
    part, areas = sized_parts(solid)
    if len(areas) < 3:
        return np.zeros(solid.shape, dtype=bool)
    kept = np.zeros(len(areas))
    for look in looks:
        afloat = sample_picture(
            look.texture.afloat.view(np.uint8), (look.x, look.y), cv2.INTER_NEAREST
        )
        share = np.bincount(part.ravel(), ((afloat > 0) & look.seen).ravel(), len(areas)) / areas
        kept = np.maximum(kept, share)
    kept[areas > LEGS * areas[1:].sum()] = 1
    kept[0] = kept[1 + int(areas[1:].argmax())] = 1
    off = (kept < AFLOAT)[part]
    return dilate(off, 2) & (off | ~solid)


def _as_drawn(texture: Texture, points: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 4"]:
    """Return a drawing as it is on the sheet where surface points lie in it, premultiplied."""
    places, _, _ = places_in(texture.drawn_by, points)
    x, y = (np.round(at, 3) for at in places)  # at the drawing's own camera its very pixels
    return np.asarray(cv2.remap(texture.drawn, x, y, cv2.INTER_CUBIC).clip(0, 1))


def _with_lines(
    drawings: Drawings,
    paint: Float[np.ndarray, "h w 3"],
    alpha: Float[np.ndarray, "h w"],
    ink: Float[np.ndarray, "h w"],
    whole: Float[np.ndarray, "h w 4"],
    part: np.float32,
) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w"]]:
    """Return colour, premultiplied, and coverage of paint with its lines; `whole`: see above."""
    pen = drawings.pen
    drawn_with = np.array(pen.rgb if pen else (0, 0, 0), np.float32) / np.float32(255)
    rgb = paint * cv2.merge([alpha - ink] * 3)  # faster than one channel for three
    if pen:
        rgb += cv2.merge([ink * level for level in drawn_with])
    if part > 0 and pen == drawings.outline:  # the drawing's own line, too
        drawn = np.minimum(whole[..., :3], whole[..., 3:])
        mix = part * whole[..., 3:] * alpha[..., None]
        rgb = rgb * (1 - part * whole[..., 3:]) + mix * drawn / np.maximum(whole[..., 3:], 1e-6)
        last = max(np.float32(0), 2 * part - 1)  # what the surface lacks is there as a whole or not
        rgb, alpha = rgb + last * (drawn - rgb), alpha + last * (whole[..., 3] - alpha)
    return rgb, alpha


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
