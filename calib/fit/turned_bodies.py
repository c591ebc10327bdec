"""Widen sigmas where bodies differ between drawings, by the scatter of elevation and roll.

An artist draws a slightly different body every time: a head turned, arms swung, the whole figure
leaning a little. To a fit of one body that looks like another camera,

    apparent_i = true_i + turned_i,    turned_i ~ N(0, tau^2)

with tau times YAW in yaw and times ROLL in roll, and no outline of one drawing tells the two apart.
The sheet does: artists mean to draw upright figures from one height, so where elevation *and* roll
scatter by more than their own uncertainty, bodies turn,

    tau^2 = min(var elevation - sigma^2, (mean roll^2 - sigma^2) / ROLL^2)

and yaw is off as well, where nothing else shows it. Every angle then moves to what the sheet means,
by its share of the variance, and the sigmas grow by the rest. A view far off its place in the turn
was meant to be there and is moved little, as the sheet's tie of yaw pulls it little.

Source: shrinkage in a random effects model (DerSimonian and Laird 1986, moments; Gelman et al.,
Bayesian Data Analysis, chapter 5). The ratios are those of synthetic artists' sheets
(docs/decisions.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.fit.sheet_prior import TAIL, Spreads, Turn, off_places, yaw_slope
from toonset.calib.fit.tilt import tilt
from toonset.calib.outline.pose import PARAMETERS
from toonset.camera import angles_from_rotation, rotation_from_angles

YAW, ROLL = 1.7, 0.5  # of what bodies turn in elevation
MOST = np.radians(2.0)  # beyond it is another pose, not the same one drawn again
LEVEL, UPRIGHT = np.radians(0.7), np.radians(0.5)  # how well artists keep elevation and roll
FEWEST = 4  # views whose scatter tells
TIED = 0.3  # least share of a variance that the drawings decide


def account_for_turned_bodies(joint: JointFit, turn: Turn, kept: Sequence[bool] = ()) -> JointFit:
    """Shrink the fit's rotations and widen their covariance for bodies that turn.

    Unchanged where elevation or roll scatter no more than they are uncertain.

    Args:
        joint: of one body, its covariance true where every drawing shows that body.
        turn: where the views are meant to be seen from.
        kept: which views a person has locked; they stay as they are. Empty for none.
    """
    views = len(joint.poses)
    if views < FEWEST:
        return joint
    slopes = np.stack([np.vstack([yaw_slope(pose), tilt(pose)[1][::-1]]) for pose in joint.poses])
    own = [slice(i, i + 3) for i in range(0, PARAMETERS * views, PARAMETERS)]
    covariance = joint.covariance.copy()
    sigmas = np.stack([by @ covariance[at, at] @ by.T for by, at in zip(slopes, own, strict=True)])
    variances = np.diagonal(sigmas, axis1=1, axis2=2)
    angles = np.array([angles_from_rotation(pose.rotation) for pose in joint.poses])
    off = angles - (0, angles[:, 1].mean(), 0)
    off[:, 0] = off_places(joint.poses, turn)
    scatter, leaning = _beyond(off, variances, joint.spreads)
    variance = min(scatter, leaning / ROLL**2, MOST**2)
    if variance <= 0:
        return joint
    turned = variance * np.array([YAW**2, 1, ROLL**2])
    level, upright = max(scatter - variance, LEVEL**2), max(leaning - turned[2], UPRIGHT**2)
    meant = np.array([Spreads().yaw ** 2, level, upright])
    taken = np.tile(turned / (meant + turned), (views, 1))
    far = (TAIL + 1) / (TAIL + off[:, 0] ** 2 / (meant[0] + turned[0]))
    taken[:, 0] *= np.where(np.isfinite(turn.places), np.minimum(far, 1), 0)
    free = ~np.array(kept or (False,) * views)
    angles -= taken * off * free[:, None]
    rotations = [rotation_from_angles(*row) for row in angles.tolist()]
    poses = [
        replace(p, rotation=r) if moves else p
        for p, r, moves in zip(joint.poses, rotations, free, strict=True)
    ]
    for at, by, share in compress(zip(own, slopes, taken, strict=True), free):
        back = np.linalg.pinv(by)
        covariance[at, at] += back @ np.diag((1 - share) * turned) @ back.T
    noise = replace(joint.noise, turned=float(np.sqrt(variance)))
    return replace(joint, poses=tuple(poses), covariance=covariance, noise=noise)


def _beyond(
    off: Float[np.ndarray, "views 3"], variances: Float[np.ndarray, "views 3"], spreads: Spreads
) -> tuple[float, float]:
    """Return by how much elevations and rolls vary beyond their uncertainty.

    The fit has tied both; a tie multiplies deviation and variance by the same, which is undone.
    """
    tied = np.array([spreads.elevation, spreads.roll])
    grown = 1 / np.maximum(1 - variances[:, 1:] / tied**2, TIED)
    squares, unsure = (off[:, 1:] * grown) ** 2, (variances[:, 1:] * grown).mean(axis=0)
    scatter = squares[:, 0].sum() / (len(off) - 1) - unsure[0]
    return float(scatter), float(squares[:, 1].mean() - unsure[1])
