"""What else gives cameras: clicked landmarks with PnP, and a contour tracker.

Both are given their best chance: the landmarks are spread well, none is hidden, and the lens that
they are seen through is known; the tracker sees clean masks instead of drawn lines. Nothing here
judges its own result.

Source: Terzakis and Lourakis, "A consistently fast and globally optimal solution to the
Perspective-n-Point problem", 2020 (SQPnP); Harris and Stennett, "RAPID, a video rate object
tracker", 1990.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from zlib import crc32

import cv2
import numpy as np
from jaxtyping import Float, Int

from lab.bench.cases.cases import CalibCase
from toonset.camera import Camera, rotation_from_angles
from toonset.mesh import Mesh
from toonset.view import View

NOMINAL_ELEVATION = math.radians(5.0)
HEIGHTS = 10.0  # distance of the pinhole, in body heights
LANDMARKS = 12
BODY_PX = 1000.0  # height of the body on which landmarks are clicked
ITERATIONS = 32
LINES = 200  # on which the tracker looks for the outline
REACHES = (0.1, 0.05, 0.03, 0.015)  # of the figure's height, that it looks away; in turn
MARGIN = 0.25  # of the figure's height, round the tracker's picture

Rotation = Float[np.ndarray, "3 3"]
Baseline = Callable[[CalibCase, int], list[Rotation | None]]  # of a sheet and a seed


def nominal_rotations(views: int) -> list[Rotation]:
    """Return the rotations of who takes the drawings for even turns, a little from above."""
    turns = (2 * math.pi * i / views for i in range(views))
    return [rotation_from_angles(turn, NOMINAL_ELEVATION, 0.0) for turn in turns]


def boxed(mesh: Mesh, view: View, rotation: Rotation) -> Camera:
    """Return the orthographic camera that shows the mesh as high as the figure, in its middle."""
    local = (mesh.vertices - mesh.middle) @ rotation[:2].T
    low, high = local.min(axis=0), local.max(axis=0)
    x, y, width, height = view.figure_box
    scale = height / float(high[1] - low[1])
    middle = np.array([x - view.box[0] + width / 2, y - view.box[1] + height / 2])
    center = middle - scale * (low + high) / 2
    return Camera(rotation, mesh.middle, scale, center, view.rgba.shape[1::-1])


def spread_vertices(mesh: Mesh, count: int, rng: np.random.Generator) -> Int[np.ndarray, " n"]:
    """Return vertices that are far apart: from a random one on, the one farthest from the others.

    Source: Gonzalez, "Clustering to minimize the maximum intercluster distance", 1985.
    """
    chosen = [int(rng.integers(len(mesh.vertices)))]
    distance = np.full(len(mesh.vertices), np.inf)
    for _ in range(count - 1):
        offsets = mesh.vertices - mesh.vertices[chosen[-1]]
        distance = np.minimum(distance, np.linalg.norm(offsets, axis=1))
        chosen.append(int(distance.argmax()))
    return np.array(chosen)


def by_landmarks(case: CalibCase, seed: int, *, noise: float) -> list[Rotation | None]:
    """Return PnP's rotations from clicked landmarks.

    The points are the mannequin's; they are clicked where the drawn body has them. Where that body
    is not known, they are clicked on the mannequin, which is optimistic if it is another one.

    Args:
        case: sheet.
        seed: of the choice of landmarks and of the noise; every sheet has its own.
        noise: standard deviation of a click, along either axis, as a share of the body's height.
    """
    rng = np.random.default_rng([seed, crc32(case.name.encode())])
    drawn = case.drawn or case.mesh
    chosen = spread_vertices(case.mesh, LANDMARKS, rng)
    known, seen = case.mesh.vertices[chosen], drawn.vertices[chosen]
    scale, k = BODY_PX / drawn.height, 1 / (HEIGHTS * drawn.height)
    lens = Camera(np.eye(3), drawn.middle, scale, np.zeros(2), (1, 1), k).K
    clicks = []
    for rotation in case.rotations:
        camera = Camera(rotation, drawn.middle, scale, np.zeros(2), (1, 1), k)
        clicks.append(
            camera.project(seen)[0] + rng.normal(scale=noise * BODY_PX, size=(LANDMARKS, 2))
        )
    return [solved(known, pixels, lens) for pixels in clicks]


def solved(
    points: Float[np.ndarray, "n 3"], pixels: Float[np.ndarray, "n 2"], K: Float[np.ndarray, "3 3"]
) -> Rotation | None:
    """Return the rotation by SQPnP and Levenberg-Marquardt; None if there is no solution."""
    try:
        found, turn, offset = cv2.solvePnP(points, pixels, K, None, flags=cv2.SOLVEPNP_SQPNP)
        if not found:
            return None
        turn, offset = cv2.solvePnPRefineLM(points, pixels, K, None, turn, offset)
    except cv2.error:  # raised by assertions on the points' variance
        return None
    return _before_camera(turn, offset, points)


def tracked(case: CalibCase, seed: int) -> list[Rotation | None]:
    """Return OpenCV's contour tracker's rotations, from the nominal angles on; nothing is random.

    Its lens is far, its first place and size are those of the figure's box.
    """
    del seed
    turns = nominal_rotations(len(case.views))
    pairs = zip(case.views, turns, strict=True)
    return [track(case.mesh, view, boxed(case.mesh, view, turn)) for view, turn in pairs]


def track(mesh: Mesh, view: View, start: Camera) -> Rotation | None:
    """Return where the tracker goes from an orthographic start; None where it loses the figure."""
    height = view.figure_box[3]
    margin = math.ceil(MARGIN * height)
    picture = np.pad(view.rgba[..., 3], margin)
    size = picture.shape[1::-1]
    camera = start.moved((-margin, -margin), size).as_pinhole(HEIGHTS * mesh.height)
    K = camera.K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # OpenCV's pixel centres
    points, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)
    turn = cv2.Rodrigues(camera.rotation)[0]
    offset = camera.camera_from_world[:3, 3:].copy()
    for number in range(ITERATIONS):
        reach = max(2, round(REACHES[number * len(REACHES) // ITERATIONS] * height))
        try:
            matched, turn, offset, _ = cv2.rapid.rapid(
                picture, LINES, reach, points, faces, K, turn, offset
            )
        except cv2.error:  # an assertion: nothing of the body is left in the picture
            return None
        if not matched:
            return None
    return _before_camera(turn, offset, mesh.vertices)


def _before_camera(
    turn: Float[np.ndarray, "3 1"],
    offset: Float[np.ndarray, "3 1"],
    points: Float[np.ndarray, "n 3"],
) -> Rotation | None:
    if not np.isfinite([turn, offset]).all():
        return None
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    before = (points @ rotation[2] + offset[2, 0]).min() > 0
    return rotation if before else None


BASELINES: Mapping[str, Baseline] = {
    "nominal angles": lambda case, _: [*nominal_rotations(len(case.views))],
    "PnP, landmarks 1 % off": partial(by_landmarks, noise=0.01),
    "PnP, landmarks 2 % off": partial(by_landmarks, noise=0.02),
    "PnP, landmarks 4 % off": partial(by_landmarks, noise=0.04),
    "cv2.rapid": tracked,
}
