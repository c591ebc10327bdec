"""Compute a scene's shape: a visual hull, carved and faired, or, of few drawings, sections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
import torch.nn.functional as F

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import alpha_of, figure_px, widen_thin_parts
from toonset.errors import BundleError
from toonset.nerf.hull.fairing import SLOPE, fair_hull
from toonset.nerf.hull.hull import LEVEL, Hull, carve
from toonset.nerf.hull.tolerance import HullEvidence, choose_missing
from toonset.nerf.options import TrainOptions
from toonset.nerf.sections.grid import VOXEL_PX, Solid
from toonset.nerf.sections.roles import wants_sections
from toonset.nerf.sections.shape import shape_of

VOXELS_PER_PX, VOXELS = 1.8, (64, 300)
WIDE_FROM = 6  # views from which thin parts are as wide as they cover pixels (docs/decisions.md)
LEVELS = 15  # of support above 0: a border lies within 0.03 px, in a quarter less of a saved model
SLACK = 1.5  # times the outlines' disagreement: as far as the surface may leave the hull


def hull_of(
    scene: Scene, options: TrainOptions, apart_px: float = 0.0, plane_x: float | None = None
) -> tuple[Hull, HullEvidence]:
    """Return the shape of a scene's drawings as a hull, and the evidence for its tolerance.

    Drawings that leave much of half a turn without an outline get elliptic sections; others their
    visual hull, faired.

    Args:
        scene: posed pictures.
        options: `missing_views` and `fairing` are used; either asks for a visual hull.
        apart_px: by how much the outlines disagree, root mean square.
        plane_x: of the body's mirror plane x = const; None: it has none. For sections only.

    Raises:
        BundleError: fewer than two views show a figure, or the views share no volume.
    """
    frames = [frame for frame in scene.frames if figure_px(frame)]
    if len(frames) < 2:
        raise BundleError(
            f"{scene.name}: {len(frames)} picture(s) with an opaque figure; at least two views "
            "with transparent background are needed"
        )
    voxels = per_px(scene, VOXELS_PER_PX, VOXELS)
    if has_sections(scene, options):
        return as_stored(hull_of_solid(shape_of(frames, plane_x), voxels)), HullEvidence(0, ())
    cameras = [frame.camera for frame in frames]
    alphas = [torch.as_tensor(alpha_of(frame)) for frame in frames]
    missing = options.missing_views
    evidence = HullEvidence(missing, ()) if missing is not None else choose_missing(cameras, alphas)
    wide = [torch.as_tensor(widen_thin_parts(alpha.numpy())) for alpha in alphas]
    hull = carve(cameras, wide if len(frames) >= WIDE_FROM else alphas, voxels, evidence.missing)
    slack = SLACK * apart_px / (hull.voxel * max(camera.scale for camera in cameras))
    hull = fair_hull(hull, cameras, alphas, slack) if options.fairing else hull
    return as_stored(hull), evidence


def has_sections(scene: Scene, options: TrainOptions) -> bool:
    """Return whether a scene's shape is made of sections, not of its visual hull."""
    if not options.fairing or options.missing_views is not None:
        return False
    cameras = [frame.camera for frame in scene.frames if figure_px(frame)]
    return len(cameras) > 1 and wants_sections(cameras)


def as_stored(hull: Hull) -> Hull:
    """Return the hull as run folders hold it: in bytes. It is trained on as it will be loaded."""
    return replace(hull, support=(hull.support * LEVELS).round() * (255 // LEVELS) / 255)


def per_px(scene: Scene, factor: float, limits: tuple[int, int]) -> int:
    """Return `factor` times the size of the largest figure in pixels, within limits."""
    size = max(figure_px(frame) for frame in scene.frames)
    return int(np.clip(round(factor * size), *limits))


def hull_of_solid(solid: Solid, voxels: int) -> Hull:
    """Return a body of sections as a hull of at most so many voxels along its longest side.

    Its border is as sharp as that of a hull which was carved.
    """
    grid = solid.grid
    factor = max(1, voxels // max(grid.shape))
    f = torch.as_tensor(solid.f)[None, None] / VOXEL_PX
    fine = F.interpolate(f, scale_factor=factor, mode="trilinear") if factor > 1 else f
    support = (LEVEL - SLOPE * factor * fine[0, 0]).clamp_(0, 1)
    return Hull(np.asarray(grid.low), grid.voxel / factor, support.contiguous())
