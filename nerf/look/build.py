"""Build the drawn look's textures from the drawings that a field was trained on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import has_figure, mask_of
from toonset.nerf.hull.hull import Hull
from toonset.nerf.hull.mannequin_shape import Shape, shape_of
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.look.drawing import Drawing, Original, levels_of
from toonset.nerf.look.drawings import STEP, Drawings
from toonset.nerf.look.flat_paint import flat_paint
from toonset.nerf.look.outline import outline_of
from toonset.nerf.look.paint_flow import Depths, pair_flows
from toonset.nerf.sections.own_limbs import OwnLimbs, own_limbs
from toonset.nerf.sections.roles import at_eye_level

COARSE, MOST_COLORS = 32, 12  # levels of a channel that count as one; colours


def drawings_of(
    ready: Scene,
    drawn: Scene,
    depth_of: Depths,
    shape: Shape | None = None,
    differences: Sequence[Bool[np.ndarray, "height width"] | None] = (),
    hull: Hull | None = None,
    *,
    bent: bool,
) -> Drawings | None:
    """Build the drawn look's drawings; None if no drawing, or no field, shows a figure.

    Args:
        ready: the drawings as they were trained on, mirrored ones behind them.
        drawn: the same as they are on the sheet. Bending blurs lines: the outline is measured here.
        depth_of: the field's surface as a camera sees it, nan where there is none.
        shape: the mannequin's, where it is the character's: the surface is its own then.
        differences: per drawing along the mirror plane where it shows that left and right differ,
            None of others; empty where nothing is mirrored.
        hull: that the field lies in.
        bent: whether they were bent.
    """
    known = [*differences, *[None] * (len(ready.frames) - len(differences))]
    rows = [
        row for row in zip(ready.frames, drawn.frames, known, strict=True) if has_figure(row[0])
    ]
    if not rows:
        return None
    frames = [frame for frame, _, _ in rows]
    sights = None
    if shape is not None:
        sights = [shape.seen(frame.camera, normals=True) for frame in frames]
        depths = [sight.depth for sight in sights]
    else:
        depths = side_by_side([partial(depth_of, frame.camera) for frame in frames])
    limbs: list[Shape | None] = [None] * len(frames)
    if shape is None and hull is not None:
        for number, own in enumerate(_own_limbs(frames, hull, depth_of)):
            if own is None:
                continue
            depths[number] = np.where(own.denied, np.nan, depths[number])
            if own.mesh is not None:
                camera = frames[number].camera
                limbs[number] = body = shape_of(own.mesh, [camera])
                depths[number] = np.fmin(depths[number], body.seen(camera).depth)
    seen = np.concatenate([depth[np.isfinite(depth)] for depth in depths])
    if not len(seen):
        return None
    extent = (float(seen.min()), float(seen.max()))
    height = float(np.median([_tall(frame.rgba) / frame.camera.scale for frame in frames]))
    line = outline_of([own.rgba for own in drawn.frames if not own.mirrored])
    flat = flat_paint([frame.rgba for frame in frames], line, sights, height)
    denied = _denied_places(frames, depths, [differs for _, _, differs in rows], STEP * height)
    shown = [np.where(out, np.nan, depth) for out, depth in zip(denied, depths, strict=True)]
    views = tuple(
        Drawing(
            frame.camera,
            frame.rgba,
            paint,
            levels_of(depth, extent) if shape is None else None,
            frame.mirrored,
            _original(frame, own),
            limb,
        )
        for (frame, own, _), paint, depth, limb in zip(rows, flat.paints, shown, limbs, strict=True)
    )
    palette = ready.palette if ready.palette is not None else _common_colors(views)
    found = Drawings(views, (), line, line, palette, height, extent, bent, shape)
    found = replace(found, steps=flat.steps, shade=flat.shade)
    if ready.palette is not None:
        found = replace(found, shadow=ready.shadow, ramps=ready.ramps)
    return found.with_flows(pair_flows(found, depth_of))


def _own_limbs(frames: Sequence[Frame], hull: Hull, depth_of: Depths) -> list[OwnLimbs | None]:
    """Return per drawing what it shows otherwise than the field."""
    if len(frames) < 2 or not at_eye_level([frame.camera for frame in frames]):
        return [None] * len(frames)

    def shows(camera: Camera) -> Bool[np.ndarray, "height width"]:
        return np.isfinite(depth_of(camera))

    return own_limbs(frames, hull.support.numpy(), hull.low, hull.voxel, shows)


def _denied_places(
    frames: Sequence[Frame],
    depths: Sequence[Float[np.ndarray, "height width"]],
    differences: Sequence[Bool[np.ndarray, "height width"] | None],
    slack: float,
) -> list[Bool[np.ndarray, "height width"]]:
    """Return per drawing the pixels that it must not show; none but of mirrored drawings.

    Args:
        frames: drawings, some of them mirrored.
        depths: of the surface that each shows, nan where there is none.
        differences: per drawing of both halves where they differ, None of the others.
        slack: world units that a place may lie behind the surface that a drawing shows.
    """
    judges = [
        (frame, np.nan_to_num(depth, nan=-np.inf).astype(np.float32), differs.astype(np.uint8))
        for frame, depth, differs in zip(frames, depths, differences, strict=True)
        if differs is not None and differs.any()
    ]
    found = []
    for frame, depth in zip(frames, depths, strict=True):
        denied = np.zeros(depth.shape, dtype=bool)
        for judge, surface, differs in judges if frame.mirrored else ():
            points = frame.camera.unproject(frame.camera.pixel_grid(), np.nan_to_num(depth))
            pixels, behind, front = judge.camera.project(points)
            x, y = (
                np.nan_to_num(pixels[..., k] - 0.5, nan=-1e4).astype(np.float32) for k in (0, 1)
            )
            there = cv2.remap(surface, x, y, cv2.INTER_NEAREST, borderValue=-np.inf)
            unlike = cv2.remap(differs, x, y, cv2.INTER_NEAREST, borderValue=0) > 0
            denied |= unlike & front & (behind <= there + slack) & np.isfinite(depth)
        found.append(denied)
    return found


def _original(frame: Frame, own: Frame) -> Original | None:
    """Return a drawing as it is on the sheet; None where it was neither bent nor moved."""
    cameras = (frame.camera, own.camera)
    points = [camera.project(np.eye(3)) for camera in cameras]
    kept = np.array_equal(frame.rgba, own.rgba) and np.array_equal(points[0][0], points[1][0])
    return None if kept else Original(own.camera, own.rgba)


def _tall(rgba: UInt8[np.ndarray, "height width 4"]) -> int:
    rows = np.flatnonzero(mask_of(rgba).any(axis=1))
    return int(rows[-1] - rows[0] + 1)


def _common_colors(views: Sequence[Drawing]) -> UInt8[np.ndarray, "colors 3"]:
    """Return the commonest colours, for drawings without a palette."""
    shown = np.concatenate([view.rgba[mask_of(view.rgba), :3] for view in views])
    coarse, count = np.unique(shown // COARSE, axis=0, return_counts=True)
    common = coarse[np.argsort(-count, kind="stable")[:MOST_COLORS]]
    return (common * COARSE + COARSE // 2).astype(np.uint8)
