"""Update the contradiction of silhouettes when one of them turns.

What one silhouette excludes on another's rays depends on these two alone: of V(V - 1) pairs only
2(V - 1) are sampled again where one view turns. Equal to `hull_rays.contradiction` of `cut_rays`,
to the bit, but for points that the hull holds already: they count 0, however deep they lie.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.dataset.silhouettes.hull_rays import Rays, Silhouette, contradiction, figure_of, least


@dataclass(frozen=True, eq=False)
class TurnedRays:
    """The rays of a sheet's outlines, cut by its silhouettes.

    Attributes:
        silhouettes: two or more, one per view.
        rays: (views,) of every outline.
        inside: (views, views - 1) of (points, t): what the others have along a view's rays.
    """

    silhouettes: tuple[Silhouette, ...]
    rays: tuple[Rays, ...]
    inside: tuple[tuple[Float[np.ndarray, "points t"], ...], ...]

    @classmethod
    def of(cls, silhouettes: Sequence[Silhouette]) -> TurnedRays:
        """Cut the rays of all outlines."""
        figure = figure_of(silhouettes)
        rays = tuple(Rays.of(own.camera, own.points, *figure) for own in silhouettes)
        inside = tuple(
            tuple(own.inside(other) for other in _others(silhouettes, i))
            for i, own in enumerate(rays)
        )
        return cls(tuple(silhouettes), rays, inside)

    def with_turned(self, view: int, silhouette: Silhouette) -> TurnedRays:
        """Return the rays after one view turns about the point that all cameras look at."""
        silhouettes = (*self.silhouettes[:view], silhouette, *self.silhouettes[view + 1 :])
        origins, directions = silhouette.camera.rays(silhouette.points)
        turned = replace(self.rays[view], origins=origins, directions=directions)
        rays = (*self.rays[:view], turned, *self.rays[view + 1 :])
        inside = [list(row) for row in self.inside]
        inside[view] = [turned.inside(other) for other in _others(silhouettes, view)]
        for i, own in enumerate(rays):
            if i != view:
                inside[i][view - (view > i)] = own.inside(silhouette)
        return TurnedRays(silhouettes, rays, tuple(map(tuple, inside)))

    def contradiction(self) -> float:
        """Return how far outlines lie outside of the others' hull, RMS over the height."""
        return float(np.sqrt(self.mean_square()))

    def mean_square(self) -> float:
        """Return the square of the contradiction."""
        return float(np.mean([contradiction(each) for each in self._outside()]))

    def _outside(self) -> Iterator[Float[np.ndarray, " points"]]:
        """Yield of every view how deep rays come into the hull, 0 where they come into it."""
        for i, (rays, inside) in enumerate(zip(self.rays, self.inside, strict=True)):
            depth = least(inside)
            nearest = depth.argmax(axis=1)
            (out,) = np.nonzero(depth[np.arange(len(depth)), nearest] < 0)
            found = np.zeros(len(depth))
            if len(out):
                found[out] = rays.refined(_others(self.silhouettes, i), out, nearest[out])
            yield found


def _others(silhouettes: Sequence[Silhouette], i: int) -> Sequence[Silhouette]:
    return [*silhouettes[:i], *silhouettes[i + 1 :]]
