"""A mannequin in the character's proportions: bent until its outlines lie on the drawings'.

Users have no model of their character, but calibration bends the body they have, band by band of
its height (`toonset.calib.fit.proportions`), and so does this: Gauss-Newton over these numbers
alone, with the cameras as given and the two-sided outline distances of `toonset.calib.fit.align`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.align import EFFECTIVE_POINTS, NOISE_OF_HEIGHT, robust_weights
from toonset.calib.fit.proportions import Body, as_it_is
from toonset.calib.known import Known
from toonset.calib.outline.correspondences import Drawing, match
from toonset.calib.outline.mesh_edges import prepare_surface
from toonset.calib.outline.pose import Pose, pixel_slopes, project
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.mesh import Mesh
from toonset.view import View

HEIGHT_PX, POINTS = 160, 200  # of a drawing, and of its outline
# Robust widths of the steps over the figure's height: an arm may be raised quite differently at
# first. From 0.08 some are not found; the last one between 0.02 and 0.05 changes nothing.
WIDTHS = np.geomspace(0.2, 0.03, 12)


def fitted_mannequin(mesh: Mesh, scene: Scene) -> Mesh:
    """Return the mannequin with the proportions of the scene's drawings, where they show them.

    Args:
        mesh: in the drawn body's frame, about as tall.
        scene: posed drawings; each camera looks about at the middle of the mesh.

    Raises:
        SheetError: a drawing is too thin or faint to have an outline.
        CameraError: the mannequin is behind a camera.
    """
    surface = prepare_surface(mesh)
    cameras = tuple(frame.camera for frame in scene.frames)
    poses = Known(cameras=cameras).start_poses(surface.middle)
    drawings = [Drawing(drawn_contour(_view(frame)), HEIGHT_PX, POINTS) for frame in scene.frames]
    views = [(d, d.pose_in(pose)) for d, pose in zip(drawings, poses, strict=True)]
    body = as_it_is(surface)
    for width in WIDTHS:
        normal, gradient = body.precision.copy(), body.precision @ body.theta
        for drawing, pose in views:
            own_normal, own_gradient = _equations(drawing, pose, body, width * drawing.height)
            normal += own_normal
            gradient += own_gradient
        body = body.moved(-np.linalg.solve(normal, gradient))
    return replace(mesh, vertices=body.surface.vertices + surface.middle)


def _equations(
    drawing: Drawing, pose: Pose, body: Body, width_px: float
) -> tuple[Float[np.ndarray, "p p"], Float[np.ndarray, " p"]]:
    """Return a view's Gauss-Newton matrix and gradient; rim and drawn points count the same."""
    found = match(drawing, body.surface, pose)
    weights = robust_weights(found, width_px)
    weights *= EFFECTIVE_POINTS / (NOISE_OF_HEIGHT * drawing.height) ** 2
    residual = (found.normals * (project(pose, found.points) - found.targets)).sum(axis=1)
    across = np.einsum("ni,nij->nj", found.normals, pixel_slopes(pose, found.points))
    slopes = body.slopes(body.at_rest(found.points))
    rows = np.einsum("nj,njp->np", across, slopes)
    return (rows.T * weights) @ rows, rows.T @ (weights * residual)


def _view(frame: Frame) -> View:
    return View(frame.rgba, (0, 0, *frame.camera.size_wh), 0.0, frame.name)
