"""Select the camera model and the body by BIC, from simple to rich.

1. orthographic, one scale: where everything begins
2. perspective, one distance for the sheet
3. if that is proven: perspective, a distance per view; if not: orthographic, a scale per view
with drawings and a mannequin that are stretched, where that is proven
(`toonset.calib.flaws.stretched`), and the mannequin's proportions (which have priors of their
own and therefore pay Akaike's 2 per number instead of BIC's log(samples)), where its outline is
visibly not theirs or a quick test says so.

All are one model in k = 1 / distance with more or fewer numbers free, so a richer model is judged
by how far its extra numbers are from what the simpler one says, in their own covariance: BIC's gain
is d^T C^-1 d - p log(samples), with the likelihood in its quadratic approximation (Wald's test).
The covariance knows that points along a line err together (`toonset.calib.fit.drawing_error`), so
the sample size is the number of independent samples that it counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.proportions import Body
from toonset.calib.fit.sheet_adjustment import JointFit, JointProblem, SheetModel
from toonset.calib.fit.sheet_prior import Spreads
from toonset.calib.outline.pose import PARAMETERS, Pose

BIC_MARGIN = 6.0  # "strong" evidence (Kass and Raftery 1995)
# Where the mannequin is visibly another body, what its shape gets wrong looks like perspective.
DOUBTFUL_MARGIN = 300.0
# Proportions have priors, which BIC would count against them a second time: Akaike's 2 per unknown
AKAIKE = 2.0
FREE_SCALE = 0.2  # relative spread of scales that are not tied
WIDTHS = np.geomspace(0.02, 0.01, 8)
WARM_WIDTHS = np.geomspace(0.013, 0.01, 4)
# Of bodies whose outlines lack something, hair or a bag, and of those that nearly meet
BODY_WIDTHS, NEAR_BODY_WIDTHS = np.geomspace(0.04, 0.015, 8), np.geomspace(0.04, 0.01, 10)
BODY_ELEVATION = np.radians(1.5)  # half of `Spreads.elevation`: a bent body can look tilted
# Where outlines nearly meet, a quick test says whether proportions need a fit (docs/decisions.md)
QUICK_TEST_WIDTHS, QUICK_TEST_MARGIN = np.array([0.02, 0.015]), 120.0
# Drawings so far off a bent body look like another body to any (docs/decisions.md)
UNSTEADY, UNSTEADY_MARGIN = 0.009, 200.0

ORTHOGRAPHIC, SCALES = "orthographic", "orthographic, a scale per view"
SHARED, PER_VIEW = "perspective", "perspective, a distance per view"
GIVEN = "as given"
PROPORTIONS = "the mannequin's proportions"
STRETCHED, TALLER = "stretched drawings", "the mannequin's height over width"
MODELS: dict[str, SheetModel] = {
    GIVEN: SheetModel("given"),
    ORTHOGRAPHIC: SheetModel("none"),
    SCALES: SheetModel("none", Spreads(scale=FREE_SCALE)),
    SHARED: SheetModel("shared"),
    PER_VIEW: SheetModel("per view"),
}


@dataclass(frozen=True)
class ModelTest:
    """A richer model that was tried.

    Attributes:
        name: what it frees.
        bic_gain: over the model it extends; above the margin it is proven.
        unknowns: how many numbers it frees.
        margin: what the gain must exceed.
    """

    name: str
    bic_gain: float
    unknowns: float
    margin: float

    @property
    def is_proven(self) -> bool:
        """Return whether the drawings refute the simpler model."""
        return self.bic_gain > self.margin


@dataclass(frozen=True)
class ModelChoice:
    """The chosen camera model, and why.

    Attributes:
        model: name of the chosen camera model.
        distances: camera distance of every view in body heights; infinity for orthographic.
        tried: what was tried.
        effective_samples: outline samples counted as independent.
    """

    model: str
    distances: tuple[float, ...]
    tried: tuple[ModelTest, ...]
    effective_samples: float

    @property
    def is_perspective(self) -> bool:
        """Return whether the cameras are pinholes."""
        return bool(np.isfinite(self.distances).any())

    @property
    def bends_mannequin(self) -> bool:
        """Return whether the mannequin's proportions were changed."""
        bends = (PROPORTIONS, TALLER)
        return any(model_test.name in bends and model_test.is_proven for model_test in self.tried)


def select_model(
    problem: JointProblem,
    body: Body,
    poses: Sequence[Pose],
    *,
    doubtful: bool,
    keep_fov: bool = False,
) -> tuple[JointFit, ModelChoice]:
    """Return the sheet's fit under the simplest camera model that the drawings do not refute.

    Args:
        problem: the drawings at the working scale.
        body: the mannequin.
        poses: starts, full-size pixels; their k starts the search for perspective.
        doubtful: the mannequin is visibly another body.
        keep_fov: every view's k stays as it is.
    """
    views = len(poses)
    if keep_fov:
        fit = problem.fit(body, poses, WIDTHS, SheetModel("given"))
        return fit, ModelChoice(GIVEN, _distances(fit), (), problem.samples * views)
    margin = DOUBTFUL_MARGIN if doubtful else BIC_MARGIN
    samples = problem.samples * views
    fit = problem.fit(body, poses, WIDTHS, MODELS[SHARED])
    first_k = PARAMETERS * views
    gain = fit.poses[0].k ** 2 / fit.covariance[first_k, first_k] - np.log(samples)
    tried = [ModelTest(SHARED, float(gain), 1, margin)]
    model = SHARED if tried[0].is_proven else ORTHOGRAPHIC
    if model == ORTHOGRAPHIC:
        fit = problem.fit(body, poses, WIDTHS, MODELS[ORTHOGRAPHIC])
    if views > 1:
        richer = PER_VIEW if model == SHARED else SCALES
        rich = problem.fit(body, fit.poses, WARM_WIDTHS, MODELS[richer], offset=fit.offset)
        gain = _differences(rich, richer) - (views - 1) * np.log(samples)
        tried.append(ModelTest(richer, float(gain), views - 1, margin))
        if tried[1].is_proven:
            model, fit = richer, rich
    return fit, ModelChoice(model, _distances(fit), tuple(tried), samples)


def fit_proportions(
    problem: JointProblem,
    fit: JointFit,
    choice: ModelChoice,
    widths: Float[np.ndarray, " rounds"] = BODY_WIDTHS,
    margin: float = BIC_MARGIN,
) -> tuple[JointFit, ModelChoice]:
    """Fit the mannequin's proportions, too, if the drawings prove them.

    Args:
        problem: the drawings at the working scale.
        fit: theirs, the mannequin as it is.
        choice: of its camera model.
        widths: robust widths over the height of the figure.
        margin: what the gain must exceed, at least UNSTEADY_MARGIN if the drawings stay UNSTEADY.
    """
    model = MODELS[choice.model]
    spreads = replace(model.spreads, elevation=BODY_ELEVATION)
    model = replace(model, proportions=True, spreads=spreads)
    bent = problem.fit(fit.body, fit.poses, widths, model, offset=fit.offset)
    theta = bent.body.theta
    block = bent.covariance[-len(theta) :, -len(theta) :]
    unknowns = len(theta) - float(np.trace(block @ bent.body.precision))  # beside their prior
    gain = theta @ np.linalg.solve(block, theta) - AKAIKE * unknowns
    if bent.noise.smooth > UNSTEADY:
        margin = max(margin, UNSTEADY_MARGIN)
    model_test = ModelTest(PROPORTIONS, float(gain), unknowns, margin)
    choice = replace(choice, tried=(*choice.tried, model_test))
    if not model_test.is_proven:
        return fit, choice
    return bent, replace(choice, distances=_distances(bent))


def contrasts(views: int) -> Float[np.ndarray, "views unknowns"]:
    """Return orthonormal directions in which views differ, one fewer than there are views."""
    others = np.column_stack([np.ones(views), np.eye(views)[:, 1:]])
    return np.linalg.qr(others)[0][:, 1:]


def _differences(rich: JointFit, name: str) -> float:
    """Return d^T C^-1 d of the views' distances (or log scales) about their mean."""
    views = len(rich.poses)
    if name == PER_VIEW:
        values = np.array([pose.k for pose in rich.poses])
        where = PARAMETERS * views + np.arange(views)
    else:
        values = np.log([pose.scale for pose in rich.poses])
        where = PARAMETERS * np.arange(views) + 5
    covariance = rich.covariance[np.ix_(where, where)]
    over = contrasts(views)
    off = over.T @ values
    return float(off @ np.linalg.solve(over.T @ covariance @ over, off))


def _distances(fit: JointFit) -> tuple[float, ...]:
    height = fit.body.rest.height
    return tuple(1 / (p.k * height) if p.k > 0 else float("inf") for p in fit.poses)
