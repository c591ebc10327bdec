"""Bend drawings of the mannequin's own body until they show it.

Only where the mannequin predicts drawings better than they predict each other (`mannequin_fit`).
What every drawing gets wrong is then known from one common shape, and the shape between the drawn
views is known, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.empirical_bayes import Fit
from toonset.dataset.silhouettes.mask import alpha_of, figure_px, has_figure
from toonset.dataset.silhouettes.outlines import OUTLINE_POINTS, ROOM, Outlines, Square
from toonset.nerf.hull.hull import LEVEL
from toonset.nerf.hull.mannequin_fit import MannequinFit, mannequin_fit, paired, parts_left
from toonset.nerf.hull.mannequin_shape import FINER, Shape, ShapeView, shape_of
from toonset.nerf.look.outline import outline_width
from toonset.nerf.look.step_lines import learn_steps, step_places
from toonset.nerf.prepare.mannequin_bends import InnerLines, fit_bends
from toonset.nerf.prepare.smaller import at_most
from toonset.nerf.prepare.unwarp import MOST, Unwarping, Warp, warped
from toonset.palette.pixels.ink_lines import find_contour
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import quick_depth_inside

OUTSIDE = 0.25  # of an outline's width: lines that reach farther beyond the silhouette lie about it
MOST_OUTSIDE = 1.5  # of its width: what is farther out is not a line
JUDGED_PX = 400.0  # height of the figure at which a mannequin is refused
SURE = 2.5  # standard errors, from drawing to drawing


@dataclass(frozen=True, eq=False)
class Posed:
    """A scene whose mannequin was looked at.

    Attributes:
        scene: its drawings, bent to show the mannequin where that is taken for the shape.
        drawn: what was bent: as drawn, with room round the figures.
        shape: the mannequin, where it is taken for the character's shape; None: it is not.
        fit: what speaks for it; None: it could not be asked.
        unwarping: how drawings were bent; None: they were not asked.
    """

    scene: Scene
    drawn: Scene
    shape: Shape | None
    fit: MannequinFit | None
    unwarping: Unwarping | None = None

    @classmethod
    def left_alone(cls, scene: Scene, fit: MannequinFit | None = None) -> Posed:
        """Return a scene whose mannequin is not its shape."""
        return cls(scene, scene, None, fit)


def posed(scene: Scene, *, unwarp: bool = True) -> Posed:
    """Judge whether a scene's mannequin is the drawn body, and bend the drawings to it if so.

    Args:
        scene: posed drawings.
        unwarp: whether drawings may be bent.

    Raises:
        BundleError: the cameras do not belong together (see `box_of_masks`).
        MeshError: the mannequin lies in none of the pictures, or is smaller than a pixel.
    """
    if scene.mannequin is None:
        return Posed.left_alone(scene)
    small = at_most(scene, JUDGED_PX)
    if small is not scene:  # most mannequins are refused: cheaper at a smaller size
        judged = posed(small, unwarp=unwarp)
        if judged.shape is None:
            return Posed.left_alone(scene, judged.fit)
    shape = shape_of(scene.mannequin, [frame.camera for frame in scene.frames])
    shape = replace(shape, beyond=_outside(scene, shape))
    fit = mannequin_fit(scene, shape)
    if fit is None or not fit.chosen:
        return Posed.left_alone(scene, fit)
    drawn = _with_room(scene)
    bent, unwarping = bent_to(drawn, shape)  # even if not kept: what no bend explains is a part
    fit = replace(fit, left=parts_left(_beside(_in_pictures(bent, scene), shape)))
    if not fit.chosen:
        return Posed.left_alone(scene, fit)
    if not unwarp or not unwarping.applied:
        return Posed(scene, scene, shape, fit, unwarping if unwarp else None)
    return Posed(bent, drawn, shape, fit, unwarping)


def _in_pictures(bent: Scene, scene: Scene) -> list[Frame]:
    """Return the figures within their first pictures, which may have cut off what lies beyond."""
    frames = []
    for own, frame in zip(bent.frames, scene.frames, strict=True):
        width, height = frame.camera.size_wh
        room = (own.camera.size_wh[0] - width) // 2
        rgba = own.rgba[room : room + height, room : room + width]
        frames.append(replace(frame, rgba=rgba))
    return [frame for frame in frames if has_figure(frame)]


def _with_room(scene: Scene) -> Scene:
    """Return the scene with pictures so large that bent figures stay within them."""
    room = math.ceil(MOST * ROOM * max(figure_px(frame) for frame in scene.frames))

    def larger(frame: Frame) -> Frame:
        width, height = frame.camera.size_wh
        camera = frame.camera.moved((-room, -room), (width + 2 * room, height + 2 * room))
        labels = frame.labels
        if labels is not None:
            labels = np.pad(labels, room, constant_values=UNLABELLED)
        rgba = np.pad(frame.rgba, [(room, room), (room, room), (0, 0)])
        return replace(frame, camera=camera, rgba=rgba, labels=labels)

    return replace(scene, frames=tuple(map(larger, scene.frames)))


def _beside(frames: list[Frame], shape: Shape) -> Outlines:
    """Return the outlines of drawings, and the mannequin's behind them."""
    cameras = [frame.camera for frame in frames]
    seen = [shape.seen(camera).alpha for camera in cameras]
    return paired(cameras, [alpha_of(frame) for frame in frames], seen)


def _outside(scene: Scene, shape: Shape) -> float:
    """Return by how much outlines are drawn outside of the mannequin, world units.

    0 where they are drawn inside, or there are none. A line that lies about the silhouette reaches
    half its width beyond it.
    """
    frames = [frame for frame in scene.frames if has_figure(frame)]
    widths = [outline_width(frame.rgba) / frame.camera.scale for frame in frames]
    width = float(np.median(widths)) if len(frames) > 1 else 0.0
    if width <= 0 or not all((shape.seen(f.camera).alpha >= LEVEL).any() for f in frames):
        return 0.0
    outlines = _beside(frames, shape).views
    pairs = list(zip(outlines[: len(frames)], outlines[len(frames) :], strict=True))
    if not all(len(drawn.points) for drawn, _ in pairs):
        return 0.0
    off = [-float(np.median(own.at(drawn.points)[0])) / own.camera.scale for drawn, own in pairs]
    found, sure = float(np.mean(off)), SURE * float(np.std(off, ddof=1)) / len(off) ** 0.5
    return found if max(sure, OUTSIDE * width) < found < MOST_OUTSIDE * width else 0.0


def bent_to(scene: Scene, shape: Shape) -> tuple[Scene, Unwarping]:
    """Return the scene with its drawings bent to show the mannequin, and how.

    Drawings that show it within an outline's own error are returned as they are, to the bit.

    Args:
        scene: posed drawings.
        shape: the mannequin in their world.
    """
    shown = [i for i, frame in enumerate(scene.frames) if has_figure(frame)]
    frames = [scene.frames[i] for i in shown]
    sights = [shape.seen(frame.camera) for frame in frames]
    cameras = [frame.camera for frame in frames]
    alphas = [alpha_of(frame) for frame in frames]
    outlines = paired(cameras, alphas, [sight.alpha for sight in sights])
    drawn, shapes = outlines.views[: len(frames)], outlines.views[len(frames) :]
    ratio = outlines.ratio(cameras[0])
    squares = [Square(one.square.low / ratio, one.square.size / ratio) for one in drawn]
    fit = fit_bends(drawn, shapes)
    warps = [Warp.none() for _ in scene.frames]
    if fit.gain_nats > 0:
        lines = _inner_lines(frames, sights, squares, fit)
        fit = (
            replace(fit_bends(drawn, shapes, lines, fit), gain_nats=fit.gain_nats) if lines else fit
        )
        for i, square, own in zip(shown, squares, fit.numbers, strict=True):
            warps[i] = Warp(square, own)
    found = Unwarping(
        fit.gain_nats > 0,
        fit.gain_nats,
        fit.tau * squares[0].size,
        (fit.apart_px[0] / ratio, fit.apart_px[1] / ratio),
        tuple(warps),
    )
    if not found.applied:
        return scene, found
    bent = [warped(*pair) for pair in zip(scene.frames, warps, strict=True)]
    return replace(scene, frames=tuple(bent)), found


def _inner_lines(
    frames: list[Frame], sights: list[ShapeView], squares: list[Square], fit: Fit
) -> list[InnerLines] | None:
    """Return where drawings should have lines at steps in depth; None: their artist draws none.

    Args:
        frames: as drawn.
        sights: of the mannequin, as each camera sees it.
        squares: in which figures may move.
        fit: of the outlines.
    """
    width = float(np.median([outline_width(frame.rgba) for frame in frames]))
    if width <= 0:
        return None
    covers = [find_contour(frame.rgba, width) / np.float32(255) for frame in frames]
    moved = [
        _moved(cover, Warp(square, own), frame)
        for cover, frame, square, own in zip(covers, frames, squares, fit.numbers, strict=True)
    ]
    height = _height(sights)
    style = learn_steps(moved, [sight.depth for sight in sights], height, width)
    if style is None:
        return None
    found = []
    for cover, sight, square in zip(covers, sights, squares, strict=True):
        gap = square.size / ROOM / OUTLINE_POINTS
        places, across = step_places(sight.fine, style.least * height, FINER, gap)
        inside = quick_depth_inside(sight.alpha >= 0.5)
        clear = inside[tuple(np.floor(places).astype(int).T[::-1])] > width + style.width_px
        found.append(
            InnerLines(
                square.unit(places[clear]),
                across[clear],
                style.beyond_px / square.size,
                cover,
                square.low,
                square.size,
            )
        )
    return found


def _moved(
    cover: Float[np.ndarray, "height width"], warp: Warp, frame: Frame
) -> Float[np.ndarray, "height width"]:
    places = frame.camera.pixel_grid() + warp.on_grid(frame.camera.size_wh)
    x, y = np.moveaxis(places - 0.5, -1, 0).astype(np.float32)
    return cv2.remap(cover, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)


def _height(sights: list[ShapeView]) -> float:
    """Return the figure's height, world units."""
    tall = [np.flatnonzero((sight.alpha > 0).any(axis=1)) for sight in sights]
    heights = [
        (rows[-1] + 1 - rows[0]) / sight.camera.scale
        for rows, sight in zip(tall, sights, strict=True)
    ]
    return float(np.median(heights))
