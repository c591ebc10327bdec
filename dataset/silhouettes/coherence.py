"""Measure how far silhouettes cohere under their cameras, without a mesh.

Under the right cameras every outline point of a view is the picture of some point of the body, and
that point lies inside (or on the outline of) every other silhouette. With the signed distance D_j
to silhouette j's outline, positive inside, the ray X_i(p, t) through outline point p of view i has

    residual(p) = max over t of min over j != i of D_j(pixel_j(X_i(p, t)))

and a negative residual is a contradiction: the others' visual hull misses the outline by that
much. A positive one is none: a hull of few views is larger than the body. A common yaw changes
nothing; nor, under orthography, do the mirror twins of all cameras together.

Which drawing is to blame is not told by its own outline: one that is too large or turned wrongly
cuts the others. So each is left out in turn, and the share of contradictions that vanish with it
is its blame.

This checks cameras, it does not refine them: where outlines are off by 1.2 % of the height it
knows one view's yaw to 3 or 4 degrees, less well than a fitting mannequin or even turns do.

Sources: silhouette coherence of Hernandez, Schmitt, Cipolla, "Silhouette coherence for camera
calibration under circular motion" (PAMI 2007); the hull of the other views after Boyer, "On using
silhouettes for camera calibration" (ACCV 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.hull_rays import Silhouette, contradiction, cut_rays
from toonset.errors import CameraError
from toonset.view import View

TOLERANCE = 0.01  # of the height: a faithful drawing's outline is this far off
# Between faultless and damaged sheets (docs/decisions.md)
ODD_BLAME = 0.75
ODD_CONTRADICTION = 0.012  # of the height


@dataclass(frozen=True, eq=False)
class ViewCoherence:
    """Coherence of one drawing with the hull of the others.

    Attributes:
        share: share of the outline that the hull reaches within the tolerance, 0 to 1.
        contradiction: root mean square of the negative residuals over the whole outline.
        blame: share of the sheet's contradiction that vanishes without this drawing, 0 to 1.
        points: outline points, pixels of the view.
        residuals: signed, over the figure's height; negative = the others exclude the point.
    """

    share: float
    contradiction: float
    blame: float
    points: Float[np.ndarray, "points 2"]
    residuals: Float[np.ndarray, " points"]


@dataclass(frozen=True, eq=False)
class SheetCoherence:
    """Coherence of a sheet's drawings.

    Attributes:
        views: in the sheet's order.
        contradiction: root mean square over the views' contradictions.
    """

    views: tuple[ViewCoherence, ...]
    contradiction: float

    @property
    def odd_view(self) -> int | None:
        """Return the one view without which the others agree; None if there is none.

        Its camera is wrong or the drawing shows something else, such as a mirrored figure.
        """
        worst = max(range(len(self.views)), key=lambda i: self.views[i].blame)
        odd = self.views[worst].blame > ODD_BLAME and self.contradiction > ODD_CONTRADICTION
        return worst if odd and len(self.views) > 2 else None


def coherence(views: Sequence[View], cameras: Sequence[Camera]) -> SheetCoherence:
    """Return how each view agrees with the hull of all the others.

    Args:
        views: the drawings, at least two.
        cameras: theirs, in pixels of the views' crops; orthographic or pinhole.

    Raises:
        CameraError: fewer than two views, or not one camera per view.
    """
    if len(views) < 2 or len(views) != len(cameras):
        raise CameraError(
            f"coherence: found {len(views)} views and {len(cameras)} cameras; two views or more "
            "with one camera each are needed; nothing can contradict a single drawing"
        )
    silhouettes = [Silhouette(view, camera) for view, camera in zip(views, cameras, strict=True)]
    rays = [cut_rays(silhouettes, i) for i in range(len(views))]
    blame = _blame([coarse for coarse, _ in rays])
    found = tuple(
        ViewCoherence(
            float((residuals > -TOLERANCE).mean()),
            float(np.sqrt(contradiction(residuals))),
            float(blame[i]),
            silhouette.points,
            residuals,
        )
        for i, (silhouette, (_, residuals)) in enumerate(zip(silhouettes, rays, strict=True))
    )
    whole = float(np.sqrt(np.mean([view.contradiction**2 for view in found])))
    return SheetCoherence(found, whole)


def _blame(sampled: Sequence[Float[np.ndarray, "views _ t"]]) -> Float[np.ndarray, " views"]:
    """Return per view the share of the contradictions in which it is needed.

    Without view j its own outline contradicts nothing and it excludes no point of the others.
    """
    views = len(sampled)
    left = np.zeros((views, views))  # contradiction of outline i when silhouette j is left out
    everything = np.zeros(views)
    for i, rows in enumerate(sampled):
        order = np.partition(rows, 1, axis=0)[:2]
        first, nearest = rows.argmin(axis=0), order[0]
        everything[i] = contradiction(nearest.max(axis=1) + TOLERANCE)
        for j in range(views):
            without = np.where(first == j, order[1], nearest)
            left[i, j] = 0.0 if i == j else contradiction(without.max(axis=1) + TOLERANCE)
    total = everything.sum()
    if total <= 0:
        return np.zeros(views)
    return 1 - left.sum(axis=0) / total
