"""Compute a scene's shape: carve, fair and store its hull."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import alpha_of, figure_px, widen_thin_parts
from toonset.errors import BundleError
from toonset.nerf.hull.fairing import fair_hull
from toonset.nerf.hull.hull import Hull, carve
from toonset.nerf.hull.tolerance import HullEvidence, choose_missing
from toonset.nerf.options import TrainOptions

VOXELS_PER_PX, VOXELS = 1.8, (64, 300)
WIDE_FROM = 6  # views from which thin parts are as wide as they cover pixels (docs/decisions.md)
LEVELS = 15  # of support above 0: a border lies within 0.03 px, in a quarter less of a saved model
SLACK = 1.5  # times the outlines' disagreement: as far as the surface may leave the hull


def hull_of(
    scene: Scene, options: TrainOptions, apart_px: float = 0.0
) -> tuple[Hull, HullEvidence]:
    """Return the hull of a scene's masks, faired, and the evidence for its tolerance.

    Args:
        scene: posed pictures.
        options: `missing_views` and `fair` are used.
        apart_px: by how much the outlines disagree, root mean square.

    Raises:
        BundleError: fewer than two views show a figure, or the views share no volume.
    """
    frames = [frame for frame in scene.frames if figure_px(frame)]
    if len(frames) < 2:
        raise BundleError(
            f"{scene.name}: {len(frames)} picture(s) with an opaque figure; at least two views "
            "with transparent background are needed"
        )
    cameras = [frame.camera for frame in frames]
    alphas = [torch.as_tensor(alpha_of(frame)) for frame in frames]
    missing = options.missing_views
    evidence = HullEvidence(missing, ()) if missing is not None else choose_missing(cameras, alphas)
    voxels = per_px(scene, VOXELS_PER_PX, VOXELS)
    wide = [torch.as_tensor(widen_thin_parts(alpha.numpy())) for alpha in alphas]
    hull = carve(cameras, wide if len(frames) >= WIDE_FROM else alphas, voxels, evidence.missing)
    slack = SLACK * apart_px / (hull.voxel * max(camera.scale for camera in cameras))
    hull = fair_hull(hull, cameras, alphas, slack) if options.fairing else hull
    return as_stored(hull), evidence


def as_stored(hull: Hull) -> Hull:
    """Return the hull as run folders hold it: in bytes. It is trained on as it will be loaded."""
    return replace(hull, support=(hull.support * LEVELS).round() * (255 // LEVELS) / 255)


def per_px(scene: Scene, factor: float, limits: tuple[int, int]) -> int:
    """Return `factor` times the size of the largest figure in pixels, within limits."""
    size = max(figure_px(frame) for frame in scene.frames)
    return int(np.clip(round(factor * size), *limits))
