"""Refine alternatives to a chosen camera, with the drawing's own error marginalised.

Aligned to the outline alone, a camera bends to what the artist drew wrongly: a front view whose hem
is a little too round fits better from 30 degrees above. The sheet knows how far its drawings are
off (`toonset.calib.fit.drawing_error`); with that in mind, such an alternative goes back to the
chosen camera, and only those that stay are others.
"""

from __future__ import annotations

import numpy as np

from toonset.calib.fit.align import measure
from toonset.calib.fit.sheet_adjustment import JointFit, JointProblem, SheetModel
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.search.candidates import OTHER, Candidates, is_twin
from toonset.camera import rotation_distance

WIDTHS = np.full(5, 0.01)  # robust ones over the figure's height: alternatives are near an optimum
WORTH = 6.0  # nats behind the best: alternatives farther behind do not count


def refine_alternatives(
    drawing: Drawing, joint: JointFit, index: int, found: Candidates
) -> Candidates:
    """Return a view's candidates, those that count refined under the sheet's drawing error.

    The chosen camera is among them, as it is and refined like them. Its twin stays: no error of a
    drawing makes it.

    Args:
        drawing: at full resolution, the sheet's offset taken off.
        joint: the sheet's fit.
        index: of the view.
        found: refined to the outline alone.
    """
    pose, surface = joint.poses[index], joint.body.surface
    doubtful = [
        number
        for number, (fit, energy) in enumerate(zip(found.fits, found.energies, strict=True))
        if energy < WORTH
        and not is_twin(pose, fit.pose)
        and rotation_distance(fit.pose.rotation, pose.rotation) > OTHER
    ]
    if not doubtful:
        return found
    problem = JointProblem([drawing])
    kept = [fit for number, fit in enumerate(found.fits) if number not in doubtful]
    kept.append(measure(drawing, surface, drawing.pose_in(pose)))
    for start in [pose, *(found.fits[number].pose for number in doubtful)]:
        fit = problem.fit(joint.body, [start], WIDTHS, SheetModel("given"), joint.noise)
        kept.append(measure(drawing, surface, drawing.pose_in(fit.poses[0])))
    return Candidates.of(kept)
