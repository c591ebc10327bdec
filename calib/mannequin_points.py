"""Sample coloured points of the mannequin for an export: its surface and every view's contour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.calib.outline.occluding_contour import find_occluding_contour, prepare_surface
from toonset.camera import Camera
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.points import TrackedPoints, sample_surface, track_points
from toonset.mesh import Mesh

CONTOUR_SPACING_PX = 2.0
SURFACE_POINTS = 10_000  # about what a splatting trainer starts a single object from


def mannequin_points(mesh: Mesh, views: Sequence[ExportView], seed: int) -> TrackedPoints | None:
    """Return coloured points of the mannequin; None where none lies on the figure in all views."""
    cameras = [view.pinhole for view in views]
    frames = [view.frame for view in views]
    candidates = [*_rims(mesh, cameras), sample_surface(mesh, SURFACE_POINTS, seed)]
    points = track_points(np.concatenate(candidates), mesh, frames, cameras)
    return points if len(points.xyz) else None


def _rims(mesh: Mesh, cameras: Sequence[Camera]) -> list[Float[np.ndarray, "n 3"]]:
    """Return the points of the mannequin that are its outline in a view, per view."""
    surface = prepare_surface(mesh)
    contours = []
    for camera in cameras:
        pixels, _, in_front = camera.project(mesh.vertices)
        if in_front.all():
            occluding = find_occluding_contour(surface, pixels, camera.size_wh, CONTOUR_SPACING_PX)
            contours.append(occluding.points + surface.middle)
    return contours
