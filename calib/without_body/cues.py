"""Compute the drawings' own cues lazily, each once.

A sheet that is corrected is fitted again and again; these are its drawings' own and stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Float

from toonset.calib.without_body.placing import Figures, SheetCameras, place
from toonset.calib.without_body.posterior import Evidence
from toonset.calib.without_body.uneven import uneven_yaws
from toonset.view import View


class Cues:
    """The drawings of a sheet, and what has been found of them."""

    def __init__(self, views: Sequence[View]) -> None:
        """Keep the views; cues are computed when asked for."""
        self.views = views
        self._placed: dict[tuple[bytes, bytes], SheetCameras] = {}

    def are_of(self, views: Sequence[View]) -> bool:
        """Return whether these are the same drawings; what is said of them may differ."""
        return len(views) == len(self.views) and all(
            one.rgba is other.rgba and one.ends == other.ends and one.name == other.name
            for one, other in zip(views, self.views, strict=True)
        )

    @cached_property
    def figures(self) -> Figures:
        """Return the drawings, measured."""
        return Figures(self.views)

    @cached_property
    def evidence(self) -> Evidence:
        """Return paint, faces, detail and shins."""
        return Evidence.of(self.views)

    @cached_property
    def free_yaws(self) -> tuple[Float[np.ndarray, " views"], float]:
        """Return yaws that may be unevenly spaced, the first 0, and their evidence in nats."""
        return uneven_yaws(self.figures, self.evidence.paint)

    def placed(
        self, yaws: Float[np.ndarray, " views"], yaw_sigma: Float[np.ndarray, " views"]
    ) -> SheetCameras:
        """Return cameras of a turn whose outlines cohere best; see `place`, radians."""
        key = yaws.tobytes(), yaw_sigma.tobytes()
        if key not in self._placed:
            self._placed[key] = place(self.figures, yaws, yaw_sigma)
        return self._placed[key]
