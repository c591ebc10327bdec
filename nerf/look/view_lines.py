"""Lines of a view: its outline, and where one part of the figure hides another.

The outline lies between those of the drawings beside the view; what floats beside the figure,
though no drawing shows it so, is left out.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.nerf.hull.mannequin_shape import FINER, ShapeView
from toonset.nerf.look.choose import Look
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import SOLID, Geometry
from toonset.nerf.look.outline import crisp_outline, inked_outline, without_noise
from toonset.nerf.look.places import sample_picture
from toonset.nerf.look.silhouette import between_outlines, smooth_outline
from toonset.nerf.look.step_lines import draw_steps
from toonset.raster import dilate, sized_parts

BORDER = 0.7  # opacity at an outline between bent drawings, whose hull is a little too large
ROOM = 0.03  # of the figure's height, round what is drawn
AFLOAT = 0.25  # share of what floats beside a figure: so much of it has to in a drawing, too
LEGS = 0.1  # of the figure: what is larger stays, though nothing joins it


def outlined(
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


def with_lines(
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


def inner_lines(drawings: Drawings, sight: ShapeView, scale: float) -> Float[np.ndarray, "h w"]:
    """Return how far lines cover every pixel where one part of the figure hides another."""
    pen, outline, style = drawings.pen, drawings.outline, drawings.steps
    if pen is None or outline is None or style is None:
        return np.zeros(sight.alpha.shape, np.float32)
    wider = pen.width_px / max(outline.width_px, 1e-6)
    return draw_steps(sight.fine, style, drawings.height, FINER, scale * wider)


def border_of(drawings: Drawings, view: Geometry) -> float:
    """Return the opacity at an outline; in small views opacity is soft by their own pixels."""
    if not drawings.bent or drawings.shape is not None:
        return SOLID
    finer = view.camera.scale / min(one.camera.scale for one in drawings.views)
    return SOLID + min(1.0, finer) * (BORDER - SOLID)
