"""Place a turn's cameras by boxes and rows of the drawings, then make silhouettes coherent.

World frame: +Y up, the axis of the turn; +Z the front; the origin in the middle of the figure,
which is about 1 high. All cameras of a sheet have one elevation, one perspective and one scale,
and stand where the middles of the drawings' rows have the axis (`sideways`); then each is shifted,
sized and turned until the outlines are those of one body
(`toonset.dataset.silhouettes.turn_fit`).

The elevation is the one under which outlines come nearest to each other. That tells which way
round a turn goes, too: reversed, the same outlines want cameras that look up, and nobody draws so.

Source: Hernandez, Schmitt, Cipolla, "Silhouette coherence for camera calibration under circular
motion", PAMI 2007; Wong and Cipolla, "Reconstruction of sculpture from its profiles with unknown
camera positions", IEEE TIP 2004.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.tilt import LEVEL_SPREAD, elevation_shares
from toonset.calib.without_body.sideways import axis_columns
from toonset.camera import Camera
from toonset.dataset.silhouettes.hull_rays import Silhouette
from toonset.dataset.silhouettes.outlines import Square, outlines_of
from toonset.dataset.silhouettes.turn_fit import fit_turns, move_camera
from toonset.dataset.silhouettes.turned_rays import TurnedRays
from toonset.view import View

ELEVATIONS = np.radians([0.0, 2.5, 5, 7.5, 10, 12.5, 15, 20, 25, 30, 37, 45])
FEW_ELEVATIONS = ELEVATIONS[::3]  # that tell turns apart
# 1 / distance in heights: long lenses, a common one; none of 45 collected sheets has any
NEARNESS, P_PERSPECTIVE = (0.1, 0.2, 0.45), 0.05
FLOOR = 0.006  # of the height: outlines of faithful drawings, 1 % of it off, are this far apart
MEASUREMENTS = 2.0  # that count, per view: its outline errs together
HUMP = np.radians(10.0)  # half of what one hump of the elevation's likelihood takes
LEAST_GAIN = 0.5  # nats, by which a nearer camera must be better for a still nearer one to be tried
COARSE_ROUNDS, ROUNDS = 4, 12  # of Gauss-Newton at most
TAU = 0.01  # of the figure's square: first guess of how far a drawing is misplaced
LEAST_SIGMA = np.radians(1.5)  # of the elevation


@dataclass(frozen=True, eq=False)
class SheetCameras:
    """A sheet's cameras under one turn.

    Attributes:
        cameras: one per view.
        turned: (views,) by how much each was turned from the turn's own yaw, radians.
        elevation: radians.
        elevation_sigma: radians.
        apart: what is left between the outlines, root mean square over the height.
    """

    cameras: tuple[Camera, ...]
    turned: Float[np.ndarray, " views"]
    elevation: float
    elevation_sigma: float
    apart: float


NOT_PLACED = SheetCameras((), np.zeros(0), 0.0, 0.0, 0.0)


class Figures:
    """The drawings of a sheet, measured once."""

    def __init__(self, views: Sequence[View]) -> None:
        """Measure the views."""
        self.views = views
        boxes = [_box(view) for view in views]
        self.middles = [(low + high) / 2 for low, high in boxes]
        self.height_px = float(np.median([high[1] - low[1] for low, high in boxes]))
        self.alphas = [view.rgba[..., 3].astype(np.float32) / 255 for view in views]
        level = self.cameras(np.zeros(len(views)), 0.0)
        self.silhouettes = [Silhouette(*pair) for pair in zip(views, level, strict=True)]
        self._apart: dict[tuple[bytes, float], float] = {}

    def cameras(
        self, yaws: Float[np.ndarray, " views"], elevation: float, k: float = 0.0
    ) -> list[Camera]:
        """Return cameras that see the figure's middle in the middle of its box."""
        return [
            Camera.looking_at(
                np.zeros(3),
                float(yaw),
                elevation,
                self.height_px,
                (view.rgba.shape[1], view.rgba.shape[0]),
                center=middle,
                k=k,
            )
            for view, yaw, middle in zip(self.views, yaws, self.middles, strict=True)
        ]

    def sideways(self, yaws: Float[np.ndarray, " views"]) -> Figures:
        """Return the drawings, the axis of the turn where the middles of their rows have it."""
        placed = copy(self)
        placed._apart = {}
        columns = axis_columns([view.mask for view in self.views], yaws)
        placed.middles = [
            np.array([column, middle[1]])
            for column, middle in zip(columns, self.middles, strict=True)
        ]
        return placed

    def apart(
        self, yaws: Float[np.ndarray, " views"], elevations: Float[np.ndarray, " n"] = ELEVATIONS
    ) -> Float[np.ndarray, " n"]:
        """Return the contradiction of a turn under every one of `elevations`, found once."""
        found = []
        for elevation in elevations.tolist():
            key = yaws.tobytes(), elevation
            if key not in self._apart:
                self._apart[key] = self.contradiction(self.cameras(yaws, elevation))
            found.append(self._apart[key])
        return np.array(found)

    def contradiction(self, cameras: Sequence[Camera]) -> float:
        """Return how far outlines lie outside of the others' hull, RMS over the height."""
        return self.rays(cameras).contradiction() if len(cameras) > 1 else 0.0

    def rays(self, cameras: Sequence[Camera]) -> TurnedRays:
        """Return the rays of the outlines of two views or more, cut by each other."""
        return TurnedRays.of(
            [own.seen_by(c) for own, c in zip(self.silhouettes, cameras, strict=True)]
        )


def coherence_log_likelihood(
    apart: Float[np.ndarray, " n"], views: int, floor: float = FLOOR
) -> Float[np.ndarray, " n"]:
    """Return the log-likelihood of outlines that lie so far apart, their noise profiled out."""
    return -0.5 * MEASUREMENTS * views * np.log(np.square(apart) + floor**2)


def place(
    figures: Figures, yaws: Float[np.ndarray, " views"], yaw_sigma: Float[np.ndarray, " views"]
) -> SheetCameras:
    """Return cameras of the turn whose outlines cohere best.

    Args:
        figures: the drawings.
        yaws: of the turn, radians.
        yaw_sigma: by how much each may leave its place in the turn, radians; 0: not at all.
    """
    views = len(figures.views)
    if views < 3:
        level = tuple(figures.cameras(yaws, 0.0))
        return SheetCameras(level, np.zeros(views), 0.0, float(LEVEL_SPREAD), 0.0)
    figures = figures.sideways(yaws)
    elevation, sigma = _elevation(figures, yaws)
    flat = _fitted(figures, figures.cameras(yaws, elevation), yaw_sigma, ROUNDS)
    found = _with_perspective(figures, yaws, yaw_sigma, flat)
    return replace(found, elevation=elevation, elevation_sigma=sigma)


def _elevation(figures: Figures, yaws: Float[np.ndarray, " views"]) -> tuple[float, float]:
    """Return the elevation of a turn and its sigma, radians: the mean over the likeliest hump.

    Places up and down are not fitted first: from far enough above, moved drawings cohere whatever
    they show.
    """
    likely = coherence_log_likelihood(figures.apart(yaws), len(yaws))
    shares = elevation_shares(ELEVATIONS) * np.exp(likely - likely.max())
    shares *= np.abs(ELEVATIONS - ELEVATIONS[shares.argmax()]) <= HUMP
    shares /= shares.sum()
    mean = float(shares @ ELEVATIONS)
    spread = float(np.sqrt(shares @ np.square(ELEVATIONS - mean)))
    return mean, max(spread, float(LEAST_SIGMA))


def _with_perspective(
    figures: Figures,
    yaws: Float[np.ndarray, " views"],
    yaw_sigma: Float[np.ndarray, " views"],
    flat: SheetCameras,
) -> SheetCameras:
    """Return the cameras with perspective where outlines prove it, else the orthographic ones.

    Args:
        figures: the drawings.
        yaws: of the turn, radians.
        yaw_sigma: as for `place`.
        flat: the orthographic cameras of the turn.
    """
    views = len(figures.views)
    cost = np.log((1 - P_PERSPECTIVE) * len(NEARNESS) / P_PERSPECTIVE)

    def worth(apart: float) -> float:
        return float(coherence_log_likelihood(np.array(apart), views))

    if worth(0.0) < worth(flat.apart) + cost:
        return flat
    nearer: list[SheetCameras] = []
    for k in NEARNESS:
        cameras = _placed_as(flat, figures.cameras(yaws, flat.elevation, k))
        nearer.append(_fitted(figures, cameras, yaw_sigma, COARSE_ROUNDS))
        last = nearer[-2] if len(nearer) > 1 else flat
        if worth(nearer[-1].apart) < worth(last.apart) + LEAST_GAIN:
            break
    best = min(nearer, key=lambda found: found.apart)
    if worth(best.apart) < worth(flat.apart) + cost:
        return flat
    return _fitted(figures, list(best.cameras), yaw_sigma, ROUNDS)


def size_of_figures(views: Sequence[View], cameras: Sequence[Camera]) -> tuple[float, float]:
    """Return height and radius about the cameras' targets that figures have, world units."""
    boxes = [_box(view) for view in views]
    heights = [
        (high - low)[1] / camera.scale for (low, high), camera in zip(boxes, cameras, strict=True)
    ]
    reach = [
        float(np.abs(corner - camera.center).max()) / camera.scale
        for box, camera in zip(boxes, cameras, strict=True)
        for corner in box
    ]
    return float(np.median(heights)), max(reach)


def _placed_as(fitted: SheetCameras | None, cameras: list[Camera]) -> list[Camera]:
    """Return cameras where others of the same sheet were found: that is near, boxes may be far.

    Sizes begin alike: what is drawn at another scale may be another character.
    """
    if fitted is None:
        return cameras
    pairs = zip(cameras, fitted.cameras, strict=True)
    return [replace(camera, center=near.center) for camera, near in pairs]


def _fitted(
    figures: Figures, cameras: list[Camera], yaw_sigma: Float[np.ndarray, " views"], rounds: int
) -> SheetCameras:
    outlines = outlines_of(cameras, figures.alphas)
    ratio = outlines.ratio(cameras[0])
    fit = fit_turns(outlines, yaw_sigma, TAU, rounds)
    moved = [
        move_camera(camera, Square(view.square.low / ratio, view.square.size / ratio), own)
        for camera, view, own in zip(cameras, outlines.views, fit.numbers, strict=True)
    ]
    apart = fit.apart_px[1] / ratio / figures.height_px
    return SheetCameras(tuple(moved), fit.numbers[:, 3], cameras[0].angles[1], 0.0, apart)


def _box(view: View) -> tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]:
    rows, columns = np.nonzero(view.mask)
    low = np.array([columns.min(), rows.min()], dtype=np.float64)
    return low, np.array([columns.max() + 1.0, rows.max() + 1.0])
