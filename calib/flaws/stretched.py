"""Estimate drawings' aspect ratios, and the mannequin's, as far as the sheet proves them.

An artist squashes a drawing, a layout program stretches another; and a mannequin has another build
than the character. One number per drawing, the log of its height over its width, is fitted with the
cameras and a scale per view (`toonset.calib.fit.sheet_adjustment`). What differs between the
drawings is their own and becomes the pixels' aspect of their cameras; what the typical drawing has
is the mannequin's, who is made as tall. Either is proven as richer cameras are
(`toonset.calib.fit.model_selection`), else it is 0. The sheet is then calibrated anew, as if it had
been drawn so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.model_selection import (
    BIC_MARGIN,
    DOUBTFUL_MARGIN,
    FREE_SCALE,
    MODELS,
    STRETCHED,
    TALLER,
    ModelTest,
    contrasts,
)
from toonset.calib.fit.sheet_adjustment import JointFit, JointProblem
from toonset.calib.fit.sheet_prior import Spreads
from toonset.calib.result import Alternative, Calibration, CutOff, ViewCalibration
from toonset.camera import Camera
from toonset.mesh import Mesh
from toonset.view import View

FEWEST_VIEWS = 3  # two drawings do not say which of them is the stretched one
# Drawing error of 1 to 2 % of the height gains up to 95 (38 sheets), heights and widths 3 % off 180
MARGIN = 150.0
CLEAR = 3.0  # standard deviations: a drawing that is stretched by less keeps square pixels
GLANCE = np.geomspace(0.05, 0.03, 3)  # robust widths over the height: enough to see that it is none
WIDTHS = np.geomspace(0.05, 0.012, 10)


@dataclass(frozen=True)
class Stretches:
    """Stretch of drawings and mannequin; logarithms of height over width.

    Attributes:
        views: of every drawing beside the typical one; 0 where that is not proven or clear.
        mannequin: how much taller than the mannequin the typical drawing is; 0 likewise.
        tried: the evidence.
    """

    views: tuple[float, ...]
    mannequin: float
    tried: tuple[ModelTest, ...]

    @property
    def is_none(self) -> bool:
        """Return whether everything is as drawn."""
        return not self.mannequin and not any(self.views)

    def and_then(self, more: Stretches) -> Stretches:
        """Return both, with the first evidence."""
        views = tuple(a + b for a, b in zip(self.views, more.views, strict=True))
        return Stretches(views, self.mannequin + more.mannequin, self.tried or more.tried)


def nothing_stretched(views: int) -> Stretches:
    """Return the identity: no view is stretched."""
    return Stretches((0.0,) * views, 0.0, ())


def find_stretches(
    problem: JointProblem, fit: JointFit, model: str, *, doubtful: bool
) -> Stretches:
    """Return the stretches that the drawings of a sheet prove.

    Args:
        problem: the drawings at the working scale.
        fit: theirs, as if none were stretched.
        model: name of its camera model.
        doubtful: the mannequin is visibly another body.
    """
    views = len(fit.poses)
    if views < FEWEST_VIEWS:
        return nothing_stretched(views)
    free = replace(MODELS[model], stretches=True, spreads=Spreads(scale=FREE_SCALE))
    margin = DOUBTFUL_MARGIN if doubtful else MARGIN
    for widths in (GLANCE, WIDTHS):
        rich = problem.fit(fit.body, fit.poses, widths, free, offset=fit.offset)
        apart, taller = _model_tests(rich, np.log(problem.samples * views), margin)
        if max(apart.bic_gain, taller.bic_gain) <= 0:
            break
    found, sigma = np.array(rich.stretches), np.sqrt(np.diag(_covariance(rich)))
    typical = float(np.median(found))
    own = np.where(np.abs(found - typical) > CLEAR * sigma, found - typical, 0.0)
    return Stretches(
        tuple(own.tolist()) if apart.is_proven else (0.0,) * views,
        typical if taller.is_proven else 0.0,
        (apart, taller),
    )


def _covariance(rich: JointFit) -> Float[np.ndarray, "views views"]:
    """Return the covariance of the stretches; their place is that of `JointFit`."""
    views = len(rich.poses)
    first = len(rich.covariance) - 1 - views
    return rich.covariance[first : first + views, first : first + views]


def _model_tests(rich: JointFit, price: float, margin: float) -> tuple[ModelTest, ModelTest]:
    """Return the evidence that drawings differ, and that the typical one is not the mannequin's.

    Args:
        rich: a fit whose stretches and scales are free.
        price: of a number.
        margin: what the gain must exceed; strong evidence is enough for the second once the first
            is proven, for then one of the drawings must be taken for the one that is not stretched.
    """
    stretches, covariance = np.array(rich.stretches), _covariance(rich)
    views = len(stretches)

    def model_test(
        name: str, over: Float[np.ndarray, "views unknowns"], margin: float
    ) -> ModelTest:
        off, unknowns = over.T @ stretches, over.shape[1]
        gain = off @ np.linalg.solve(over.T @ covariance @ over, off) - unknowns * price
        return ModelTest(name, float(gain), unknowns, margin)

    apart = model_test(STRETCHED, contrasts(views), margin)
    if not apart.is_proven:
        return apart, model_test(TALLER, np.full((views, 1), 1 / views), margin)
    middle = np.argsort(stretches)[(views - 1) // 2 : views // 2 + 1]
    typical = np.eye(views)[:, middle].mean(axis=1, keepdims=True)
    return apart, model_test(TALLER, typical, BIC_MARGIN)


def stretch_mannequin(mesh: Mesh, stretches: Stretches) -> Mesh:
    """Return the mannequin as tall as the drawings have it; its feet stay where they are."""
    ground = mesh.vertices[:, 1].min()
    vertices = mesh.vertices.copy()
    vertices[:, 1] = ground + np.exp(stretches.mannequin) * (vertices[:, 1] - ground)
    return replace(mesh, vertices=vertices)


def unstretch(view: View, stretch: float) -> View:
    """Return a drawing without its stretch: the shorter way of its picture is made longer."""
    if not stretch:
        return view
    height, width = view.rgba.shape[:2]
    across, down = max(1.0, np.exp(stretch)), max(1.0, np.exp(-stretch))
    return view.resized((round(width * across), round(height * down)))


def as_drawn(found: Calibration, shown: Sequence[View], drawn: Sequence[View]) -> Calibration:
    """Return the calibration of unstretched drawings in pixels of those that were drawn.

    Args:
        found: of `shown`.
        shown: the drawings, unstretched.
        drawn: the same as they are.
    """
    by = [
        np.array(s.rgba.shape[1::-1]) / d.rgba.shape[1::-1]
        for s, d in zip(shown, drawn, strict=True)
    ]
    views = [
        _view_as_drawn(view, own, (d.rgba.shape[1], d.rgba.shape[0]))
        for view, own, d in zip(found.views, by, drawn, strict=True)
    ]
    numbers = {view.name: own for view, own in zip(drawn, by, strict=True)}
    cuts = tuple(_cut_as_drawn(cut, numbers[cut.view]) for cut in found.cuts)
    return replace(found, views=tuple(views), cuts=cuts)


def _view_as_drawn(
    view: ViewCalibration, by: Float[np.ndarray, " 2"], size_wh: tuple[int, int]
) -> ViewCalibration:
    if (by == 1).all():
        return view

    def drawn(camera: Camera) -> Camera:
        return replace(
            camera,
            scale=float(camera.scale / by[0]),
            pixel_aspect=float(by[0] / by[1]),
            center=camera.center / by,
            size_wh=size_wh,
        )

    units = np.array([1, 1, 1, *(1 / by), 1])
    covariance = view.covariance * np.outer(units, units)
    shift = float(np.sqrt(np.trace(covariance[3:5, 3:5]) / 2))
    others = [Alternative(drawn(other.camera), other.probability) for other in view.alternatives]
    return replace(
        view,
        camera=drawn(view.camera),
        twin=drawn(view.twin),
        alternatives=tuple(others),
        covariance=covariance,
        sigmas=replace(view.sigmas, shift_px=shift),
    )


def _cut_as_drawn(cut: CutOff, by: Float[np.ndarray, " 2"]) -> CutOff:
    own, along = by[cut.flat.axis], by[1 - cut.flat.axis]
    spans = tuple((round(a / along), round(b / along)) for a, b in cut.flat.spans)
    flat = replace(cut.flat, at=round(cut.flat.at / own), spans=spans)
    return replace(cut, flat=flat, lost_px=cut.lost_px / float(own))
