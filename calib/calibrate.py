"""Views and a mannequin to cameras: coarse hypotheses, contour alignment, the sheet together.

1. templates: silhouettes of the mesh over yaw and elevation; the best overlaps start each view
2. contour alignment of every start and its mirror twin at low resolution
3. one candidate per view, with the sheet's common elevation
4. joint refinement, orthographic and perspective; the simpler unless BIC proves the other
5. all candidates again under the shared camera model; if a view's choice changes, 4 again
6. probabilities, uncertainties, verdicts
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toonset.calib.align import EFFECTIVE_POINTS, INDEPENDENT_POINTS, Drawing, Fit
from toonset.calib.contour import drawn_contour
from toonset.calib.hypotheses import (
    Candidates,
    choose_together,
    level_twins,
    probabilities,
    refine,
    with_twins,
)
from toonset.calib.joint import JointFit, choose_model, fit_sheet
from toonset.calib.judge import judge_sheet, judge_view, with_sheet_in_mind
from toonset.calib.pose import Pose
from toonset.calib.result import Calibration
from toonset.calib.rim import Surface, prepare_surface
from toonset.calib.templates import build_templates, find_hypotheses
from toonset.mesh import Mesh
from toonset.view import View

if TYPE_CHECKING:
    from collections.abc import Iterator

Progress = Callable[[str, float], None]  # step, share done


@dataclass(frozen=True)
class CalibrationOptions:
    """How hard to look.

    Attributes:
        starts: coarse hypotheses per view; 6 reach the optimum of clean views always.
        coarse_height_px: figure height while searching; 100 px see limbs, cost little.
        fine_height_px: figure height of the final fit.
        rounds: joint fits at most, when views change their candidate.
    """

    starts: int = 6
    coarse_height_px: float = 100.0
    fine_height_px: float = 250.0
    rounds: int = 3


COARSE_WIDTHS = np.geomspace(0.08, 0.02, 8)
RECHECK_WIDTHS = np.geomspace(0.03, 0.015, 5)
NEAR_HEIGHTS = 3.0  # camera distance of the second first guess
FINE_WIDTHS = np.geomspace(0.015, 0.01, 3)
WIDTHS = np.geomspace(0.03, 0.01, 10)
SKETCHED = np.geomspace(0.03, 0.012, 6)  # a joint fit that only has to rank selections


def calibrate(
    views: Sequence[View],
    mesh: Mesh,
    options: CalibrationOptions = CalibrationOptions(),
    progress: Progress = lambda step, share: None,
) -> Calibration:
    """Return one camera per view with its uncertainty.

    Args:
        views: the drawings, at least one.
        mesh: the posed mannequin; world frame and units are its own.
        options: search effort.
        progress: called with the step's name and the share done.
    """
    seconds: dict[str, float] = {}
    with _timed(seconds, "prepare"):
        surface = prepare_surface(mesh)
        templates = build_templates(surface)
        contours = [drawn_contour(view) for view in views]
        coarse = [Drawing(c, options.coarse_height_px, 160) for c in contours]
        fine = [Drawing(c, options.fine_height_px, 400) for c in contours]
    candidates = []
    with _timed(seconds, "search"):
        for i, view in enumerate(views):
            progress("search", i / len(views))
            starts = [h.pose for h in find_hypotheses(view, templates, options.starts)]
            starts = [*starts, starts[0].twin()]
            candidates.append(refine(coarse[i], surface, starts, COARSE_WIDTHS))
    with _timed(seconds, "together"):
        progress("together", 0.0)
        joint, candidates = _search_together(coarse, surface, candidates, options.rounds)
    with _timed(seconds, "joint"):
        progress("joint", 0.0)
        flat = fit_sheet(fine, surface, _with_k(joint.poses, 0.0), perspective=False, widths=WIDTHS)
        deep = fit_sheet(fine, surface, joint.poses, perspective=True, widths=WIDTHS)
        joint, model = choose_model(flat, deep, surface, len(views))
    with _timed(seconds, "judge"):
        progress("judge", 0.0)
        final = [
            refine(drawing, surface, _rivals(pose, c), FINE_WIDTHS)
            for drawing, pose, c in zip(fine, joint.poses, candidates, strict=True)
        ]
        # perspective tells twins apart, but only where independent outline errors prove it, too
        proven = model.bic_gain > model.margin * EFFECTIVE_POINTS / INDEPENDENT_POINTS
        seen = joint.poses if proven else _with_k(joint.poses, 0.0)
        final = [level_twins(c, surface, p) for c, p in zip(final, seen, strict=True)]
        sure = probabilities(final)
        judged = with_sheet_in_mind(
            [
                judge_view(view, fine[i], surface, joint, i, final[i], sure[i])
                for i, view in enumerate(views)
            ]
        )
    verdict, reason = judge_sheet(judged)
    return Calibration(judged, model, joint.offset, joint.noise, verdict, reason, seconds)


def _search_together(
    drawings: Sequence[Drawing],
    surface: Surface,
    candidates: Sequence[Candidates],
    rounds: int,
) -> tuple[JointFit, list[Candidates]]:
    """Return the best joint fit over selections of candidates, and the candidates at its k.

    The first selections are made as if orthographic and as if seen from near by: perspective of
    two to three body heights moves outlines so much that the wrong candidate can win without it.
    """
    near = 1 / (NEAR_HEIGHTS * surface.height)
    nearby = _at_camera(drawings, surface, candidates, near)
    selections = [_selected(candidates), _selected(nearby)]
    best, found = None, list(candidates)
    for _ in range(rounds):
        fits = [_sketched_fit(drawings, surface, poses) for poses in selections]
        contender = min(fits, key=lambda fit: fit.score)
        if best is not None and contender.score >= best.score - 0.5:
            break
        best = contender
        again = [
            Candidates((Fit(pose, 0.0, 0.0, 0.0), *view.fits[:4]), view.energies)
            for pose, view in zip(best.poses, candidates, strict=True)
        ]
        found = _at_camera(drawings, surface, again, best.poses[0].k)
        selections = [_selected(found)]
    assert best is not None
    return best, found


def _rivals(pose: Pose, candidates: Candidates) -> list[Pose]:
    """Return the chosen pose, its twin and the best candidates, all with the chosen k."""
    return _with_k(with_twins([pose]) + [fit.pose for fit in candidates.fits[:4]], pose.k)


def _sketched_fit(drawings: Sequence[Drawing], surface: Surface, poses: Sequence[Pose]) -> JointFit:
    flat = fit_sheet(drawings, surface, _with_k(poses, 0.0), perspective=False, widths=SKETCHED)
    deep = fit_sheet(drawings, surface, poses, perspective=True, widths=SKETCHED)
    return choose_model(flat, deep, surface, len(drawings))[0]


def _selected(candidates: Sequence[Candidates]) -> list[Pose]:
    chosen = choose_together(candidates)
    return [view.fits[c].pose for view, c in zip(candidates, chosen, strict=True)]


def _with_k(poses: Sequence[Pose], k: float) -> list[Pose]:
    return [replace(pose, k=k) for pose in poses]


def _at_camera(
    drawings: Sequence[Drawing],
    surface: Surface,
    candidates: Sequence[Candidates],
    k: float,
) -> list[Candidates]:
    """Refine the best candidates and their twins again at a given k."""
    return [
        refine(
            drawing,
            surface,
            _with_k(with_twins([fit.pose for fit in found.fits[:4]]), k),
            RECHECK_WIDTHS,
        )
        for drawing, found in zip(drawings, candidates, strict=True)
    ]


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
