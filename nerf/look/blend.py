"""Draw a new view from the drawings: their paint, carried over the surface in whole patches.

Every place of the surface, smoothed (`surface`), is looked up in the two drawings beside the view,
each shifted towards the other by its share of how far they lie apart (`paint_flow`); what neither
shows is looked up in further ones. Every pixel shows one of them (`choose`), and what none shows
goes on with the paint beside it. The outline lies between the drawings' own (`silhouette`).

Source: Debevec, Taylor and Malik 1996 (view-dependent texture mapping); Eisemann et al. 2008
("Floating textures").
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.camera import Camera
from toonset.nerf.hull.mannequin_shape import FINER, Shape
from toonset.nerf.look.asked import flanking, looks_of, own_part
from toonset.nerf.look.border_lines import Unlined, missing_lines, missing_steps
from toonset.nerf.look.choose import Look, choose, filled_from, mixed, shared_groups
from toonset.nerf.look.crisp_depth import crisp_depth
from toonset.nerf.look.drawings import STEP, Drawings
from toonset.nerf.look.drawn_view import DRAWN, GUESSED, MIRRORED, SOLID, DrawnView, Geometry
from toonset.nerf.look.features import lines_of
from toonset.nerf.look.places import places_in, sample_picture
from toonset.nerf.look.settle import discontinuities, settled
from toonset.nerf.look.shade import smoothed
from toonset.nerf.look.stamps import NEARER, Stamp, stamped, stamps, torn
from toonset.nerf.look.surface import smooth_surface
from toonset.nerf.look.texture import Texture
from toonset.nerf.look.view_lines import ROOM, border_of, inner_lines, outlined, with_lines
from toonset.raster import dilate

EDGE_PX = 4  # round a drawing: enlarging by cubic curves reaches two pixels
# Of the height, and pixels, beside the nearest drawing: what lies farther from it is not shown
BEYOND, BESIDE_PX = 0.01, 2
Box = tuple[slice, slice]  # rows and columns


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
    fitting, border = drawings.fitting(view.camera.scale), border_of(drawings, view)
    shape, room = drawings.shape, int(np.ceil(ROOM * drawings.height * view.camera.scale)) + 1
    box = _box(view.alpha > 0, room) if shape is None else shape.box(view.camera)
    own, share = own_part(fitting, view.camera)
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
    numbers, looks = looks_of(drawings, camera, points, flank)
    if limb.any():  # which no other drawing shows
        looks = [looks[0], *(replace(one, seen=one.seen & ~limb) for one in looks[1:])]
    own, part = own_part(drawings, camera)
    whole = np.zeros((*depth.shape, 4), np.float32)
    if part > 0:
        whole = _as_drawn(drawings.textures[own], points)
    scale = looks[0].scale
    alpha, ink = outlined(drawings, view, looks, border, sight, whole[..., 3], part)
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
        breaks = discontinuities(looks, np.where(kept, chosen, -1), inside)
        color, labels = settled(color, labels, breaks, inside, pen, figure_px)
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
        ink = np.maximum(ink, np.minimum(inner_lines(drawings, sight, scale), alpha))
    rgb, alpha = with_lines(drawings, color, alpha, ink, whole, part)
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


def _as_drawn(texture: Texture, points: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 4"]:
    """Return a drawing as it is on the sheet where surface points lie in it, premultiplied."""
    places, _, _ = places_in(texture.drawn_by, points)
    x, y = (np.round(at, 3) for at in places)  # at the drawing's own camera its very pixels
    return np.asarray(cv2.remap(texture.drawn, x, y, cv2.INTER_CUBIC).clip(0, 1))
