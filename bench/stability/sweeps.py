"""The calibration pages of `python -m bench stability`: one thing about a sheet changes per sweep.

Sheets differ by their seed (body, jitter); a sweep's steps share their sheets, so that a change
from step to step is the step's effect. The base sheet has five views of an asymmetric body on 200
px cells, turned wrongly by up to 8 degrees, seen from 10 degrees above, drawn without other error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bench.stability import artist, draws
from bench.stability.page import Page
from bench.stability.sheet import DrawnSheet, Step


@dataclass(frozen=True)
class Sweep(Page):
    """A page about calibration.

    Attributes:
        draw: step and seed to a sheet.
        from_start: align every view from a start that is wrong by `step` degrees, no search.
    """

    draw: Callable[[Step, int], DrawnSheet]
    from_start: bool = False


SWEEPS = (
    Sweep(
        "start",
        "start error, degrees",
        (0, 5, 10, 15, 20, 30, 45, 60),
        (0, 20, 45, 60),
        "The contour alignment alone, from cameras turned wrongly; it gives no verdict.",
        None,
        draws.without_lines,
        from_start=True,
    ),
    Sweep(
        "views",
        "views",
        (8, 7, 6, 5, 4, 3, 2, 1),
        (8, 4, 2, 1),
        "Fewer drawings on the sheet, from all directions over the seeds.",
        None,
        draws.numbered,
    ),
    Sweep(
        "angles",
        "turned off even steps by up to, degrees",
        (0, 10, 20, 36, 72, 180),
        (0, 20, 72, 180),
        "Five views turned unequally; 180 degrees is any direction at all.",
        None,
        draws.uneven,
    ),
    Sweep(
        "scale",
        "scale error per view, ± %",
        (0, 2.5, 5, 7.5, 10),
        (0, 5, 10),
        "Views drawn too large or too small.",
        0,
        draws.misscaled,
    ),
    Sweep(
        "roll",
        "roll per view, ± degrees",
        (0, 2.5, 5, 7.5, 10),
        (0, 5, 10),
        "Figures that lean to the left or right.",
        None,
        draws.turned_over,
    ),
    Sweep(
        "warp",
        "outline warp, % of cell",
        (0, 0.5, 1, 2, 4),
        (0, 1, 2, 4),
        "Drawing error: every view smoothly bent; careful hands are within 0.5 to 1.5 %.",
        0,
        draws.warped,
    ),
    Sweep(
        "squash",
        "squash or stretch per view, %",
        (0, 5, 10, 15, 20, 30),
        (0, 10, 30),
        "Exaggeration: views taller and narrower, or lower and wider.",
        0,
        draws.squashed,
    ),
    Sweep(
        "ears",
        "radius of the ears, % of height",
        (0, 3, 5, 8, 12, 15),
        (0, 5, 15),
        "Parts that follow the viewer: round ears always face us; the mannequin's face the front.",
        0,
        draws.with_following_ears,
    ),
    Sweep(
        "line",
        "line width, px of 200",
        (0, 1, 2, 4, 6, 8),
        (0, 4, 8),
        "No contour, a thin one, thick ones.",
        2,
        draws.outlined,
    ),
    Sweep(
        "contrast",
        "contrast between colours, %",
        (100, 50, 20, 10, 5, 0),
        (100, 10, 0),
        "Colours ever more alike, at last a single flat one.",
        100,
        draws.paler,
    ),
    Sweep(
        "body",
        "body's symmetry",
        ("asymmetric", "symmetric", "vase"),
        ("asymmetric", "symmetric", "vase"),
        "A body that tells left from right, one that does not, one without any direction.",
        "asymmetric",
        draws.of_body,
    ),
    Sweep(
        "pose",
        "arms higher than the mannequin's, degrees",
        (0, 10, 20, 30, 45, 60),
        (0, 20, 60),
        "The wrong pose: the drawn figure raises its arms, the mannequin does not.",
        0,
        draws.with_arms_up,
    ),
    Sweep(
        "proportions",
        "head larger than the mannequin's, %",
        (0, 10, 20, 40, 60),
        (0, 20, 60),
        "Wrong proportions: the drawn head is larger than the mannequin's.",
        0,
        draws.with_large_head,
    ),
    Sweep(
        "hair",
        "hair ball, radius % of height",
        (0, 10, 15, 20, 25, 30),
        (0, 20, 30),
        "A ball of hair that the mannequin lacks.",
        0,
        draws.with_hair,
    ),
    Sweep(
        "prop",
        "staff, % of height",
        (0, 30, 60, 100, 150),
        (0, 60, 150),
        "An asymmetric prop: a staff in the right hand that the mannequin lacks.",
        0,
        draws.with_staff,
    ),
    Sweep(
        "gaps",
        "gaps painted shut, % of height",
        (0, 2, 4, 8, 12, 16),
        (0, 4, 16),
        "Holes between limbs that are painted shut, as a hasty cut-out does.",
        0,
        draws.with_gaps_painted,
    ),
    Sweep(
        "fragments",
        "missing, % of area",
        (0, 2, 5, 10, 20, 40),
        (0, 10, 40),
        "Figures with round pieces missing.",
        0,
        draws.fragmented,
    ),
    Sweep(
        "feet",
        "feet cropped, % of height",
        (0, 5, 10, 15, 20, 30),
        (0, 10, 30),
        "Figures cut off at the bottom.",
        0,
        draws.cropped,
    ),
    Sweep(
        "mirror",
        "mirrored views of 5",
        (0, 1, 2),
        (0, 1, 2),
        "Drawings that were flipped left to right by mistake.",
        0,
        draws.with_mirrored,
    ),
    Sweep(
        "distance",
        "camera distance, heights",
        (20, 10, 5, 3, 2.5, 2),
        (20, 5, 2),
        "Drawn in perspective, from ever nearer.",
        None,
        draws.near,
    ),
    Sweep(
        "edges",
        "blur of the sheet, px",
        (0, draws.HARD, 0.5, 1, 2, 3),
        (0, draws.HARD, 1, 3),
        "Without anti-aliasing, and blurred; cut out of a white sheet.",
        None,
        draws.blurred,
    ),
    Sweep(
        "jpeg",
        "JPEG quality",
        (draws.LOSSLESS, 95, 80, 60, 40, 20, 10, 5),
        (draws.LOSSLESS, 80, 40, 10),
        "Saved as JPEG, and cut out of the white sheet.",
        None,
        draws.compressed,
    ),
    Sweep(
        "resolution",
        "cell, px",
        (1000, 600, 400, 200, 120, 80, 60, 40),
        (200, 80, 40),
        "Large and small drawings.",
        200,
        draws.sized,
    ),
    Sweep(
        "drift",
        "bodies' differences, times an artist's",
        (0, 1, 2, 3),
        (0, 1, 3),
        "Every drawing of an artist's sheet shows another body: head turned, arms swung, the face "
        "pulled to the viewer, all points moved smoothly.",
        None,
        artist.drifted,
    ),
    Sweep(
        "shadow",
        "light that the shadow takes, %",
        (0, 15, 30, 45, 60, 80),
        (0, 30, 80),
        "A two-tone shadow whose light stays with the camera, on an artist's sheet.",
        None,
        artist.shadowed,
    ),
    Sweep(
        "grain",
        "grain of the paper, levels of 255",
        (0, 1.3, 4, 8, 16, 32),
        (0, 4, 32),
        "Ever rougher paper under an artist's sheet.",
        None,
        artist.grainy,
    ),
    Sweep(
        "mannequin",
        "mannequin",
        ("own", artist.OTHER, "plain", "none"),
        ("own", "plain", "none"),
        "An artist's sheet and the character's own body, another one's, a plain body made by code, "
        "and no body at all.",
        None,
        artist.of_mannequin,
    ),
    Sweep(
        "no mannequin",
        "views",
        (12, 8, 6, 5, 4, 3, 2),
        (8, 5, 3),
        "An artist's sheet without any mannequin, of fewer and fewer drawings.",
        None,
        artist.without_mannequin,
    ),
)
