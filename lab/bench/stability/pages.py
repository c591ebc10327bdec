"""The pages of `python -m lab.bench stability`: one thing about a sheet changes per page.

Sheets differ by their seed (body, jitter); a page's steps share their sheets, so that a change from
step to step is the step's effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from lab.bench.stability import scenes, sheets
from lab.bench.stability.bodies import with_arms_raised, with_head_grown
from lab.bench.stability.cameras import CALIBRATION
from lab.bench.stability.colors import LABELS, PAINTED, PAINTS, PALETTE, near_equal, tiny_feature
from lab.bench.stability.damage import stretched, with_gaps_closed, without_feet
from lab.bench.stability.fields import LOOK, TRAINING, look_case, look_of_turned
from lab.bench.stability.scenes import changed, draw_scene, misscaled, misturned, with_usual_views
from lab.bench.stability.sheets import (
    HARD,
    LOSSLESS,
    OTHER,
    Step,
    artists,
    as_cut_out,
    draw_sheet,
    each,
    painters,
)
from lab.bench.stability.trials import Kind, Page

Row = tuple[str, str, Sequence[Step], Step | None]  # name, axis, steps, base


def _pages(
    kind: Kind, rows: Sequence[Row], draws: dict[str, Callable[[Any, int], Any]]
) -> list[Page]:
    """Return the pages of a kind: their rows, and how their steps are drawn, by name and seed."""
    return [Page(kind, name, axis, tuple(s), base, draws[name]) for name, axis, s, base in rows]


PAGES = (
    *_pages(
        CALIBRATION,
        [
            ("views", "views", (8, 7, 6, 5, 4, 3, 2, 1), None),
            ("angles", "unequal turns, by up to degrees", (0, 10, 20, 36, 72, 180), None),
            ("scale", "scale error per view, ± %", (0, 2.5, 5, 7.5, 10), 0),
            ("warp", "outline warp, % of cell", (0, 0.5, 1, 2, 4), 0),
            ("squash", "squash or stretch per view, %", (0, 5, 10, 15, 20, 30), 0),
            ("ears", "ears that face the viewer, % of height", (0, 3, 5, 8, 12, 15), 0),
            ("line", "line width, px of 200", (0, 1, 2, 4, 6, 8), 2),
            ("body", "body's symmetry", ("asymmetric", "symmetric", "vase"), "asymmetric"),
            ("pose", "arms higher than the mannequin's, degrees", (0, 10, 20, 30, 45, 60), 0),
            ("proportions", "head larger than the mannequin's, %", (0, 10, 20, 40, 60), 0),
            ("hair", "hair that the mannequin lacks, % of height", (0, 10, 15, 20, 25, 30), 0),
            ("gaps", "gaps painted shut, % of height", (0, 2, 4, 8, 12, 16), 0),
            ("fragments", "missing, % of area", (0, 2, 5, 10, 20, 40), 0),
            ("feet", "feet cropped, % of height", (0, 5, 10, 15, 20, 30), 0),
            ("mirror", "mirrored views of 5", (0, 1, 2), 0),
            ("distance", "camera distance, heights", (20, 10, 5, 3, 2.5, 2), None),
            ("edges", "blur of the sheet, px", (0, HARD, 0.5, 1, 2, 3), None),
            ("jpeg", "JPEG quality", (LOSSLESS, 95, 80, 60, 40, 20, 10, 5), None),
            ("resolution", "cell, px", (1000, 600, 400, 200, 120, 80, 60, 40), 200),
            ("drift", "bodies' differences, times an artist's", (0, 1, 2, 3), None),
            ("shadow", "light that the shadow takes, %", (0, 15, 30, 45, 60, 80), None),
            ("grain", "grain of the paper, levels of 255", (0, 1.3, 4, 8, 16, 32), None),
            ("mannequin", "mannequin", ("own", OTHER, "plain", "none"), None),
            ("no mannequin", "views", (12, 8, 6, 5, 4, 3, 2), None),
            ("studio views", "drawings of one side", (8, 7, 6, 5, 4, 3, 2), None),
            ("studio pose", "bodies' differences, times a studio's", (0, 1, 2, 3), None),
        ],
        {
            "views": lambda s, seed: draw_sheet(seed, views=s, yaw_jitter_deg=180 / s),
            "angles": lambda s, seed: draw_sheet(seed, yaw_jitter_deg=float(s)),
            "scale": lambda s, seed: draw_sheet(seed, scale_error_percent=float(s)),
            "warp": lambda s, seed: draw_sheet(seed, warp_percent=float(s)),
            "squash": lambda s, seed: each(
                "squash", seed, lambda d, side: stretched(*d, (1 + s / 100) ** side - 1)
            ),
            "ears": lambda s, seed: sheets.with_following_ears(s / 100, seed),
            "line": lambda s, seed: draw_sheet(seed, outline_px=float(s)),
            "body": lambda s, seed: sheets.of_body(s, seed),
            "pose": lambda s, seed: sheets.of_other(
                seed, lambda body: with_arms_raised(body, math.radians(s))
            ),
            "proportions": lambda s, seed: sheets.of_other(
                seed, lambda body: with_head_grown(body, s / 100)
            ),
            "hair": lambda s, seed: sheets.with_hair(s / 100, seed),
            "gaps": lambda s, seed: each("gaps", seed, lambda d, _: with_gaps_closed(*d, s / 100)),
            "fragments": lambda s, seed: sheets.fragmented(s / 100, seed),
            "feet": lambda s, seed: each("feet", seed, lambda d, _: without_feet(*d, s / 100)),
            "mirror": lambda s, seed: sheets.with_mirrored(s, seed),
            "distance": lambda s, seed: draw_sheet(seed, distance_heights=float(s)),
            "edges": lambda s, seed: sheets.blurred(sheets.BASE, s, seed),
            "jpeg": lambda s, seed: sheets.compressed(sheets.BASE, s, seed),
            "resolution": lambda s, seed: draw_sheet(
                seed, cell_px=s, outline_px=sheets.BASE.outline_px * s / sheets.BASE.cell_px
            ),
            "drift": lambda s, seed: as_cut_out(
                artists(seed, body=sheets.ARTIST.artist.body.scaled(float(s)))
            ),
            "shadow": lambda s, seed: as_cut_out(artists(seed, shadow_strength=s / 100)),
            "grain": lambda s, seed: as_cut_out(artists(seed, grain_levels=float(s))),
            "mannequin": lambda s, seed: sheets.of_mannequin(s, seed),
            "no mannequin": lambda s, seed: sheets.without_mannequin(s, seed),
            "studio views": lambda s, seed: sheets.of_studio(seed, views=s),
            "studio pose": lambda s, seed: sheets.of_studio(seed, pose=float(s)),
        },
    ),
    *_pages(
        PALETTE,
        [
            ("palette near", "hair to skin, OKLab x 100", (20, 10, 6, 4, 3, 2, 1), None),
            ("palette tiny", "radius of the eyes, % of height", (8, 6, 4, 3, 2, 1, 0.5), None),
        ],
        {
            "palette near": lambda s, seed: near_equal(s / 100, seed),
            "palette tiny": lambda s, seed: tiny_feature(s / 100, seed),
        },
    ),
    *_pages(
        LABELS,
        [
            ("labels shadow", "light that the shadow takes, %", (0, 15, 30, 45, 60, 80), None),
            ("labels grain", "grain of the paper, levels of 255", (0, 1.3, 4, 8, 16, 32), None),
            ("labels jpeg", "JPEG quality", (LOSSLESS, 88, 60, 30, 10, 5), None),
        ],
        {
            "labels shadow": lambda s, seed: artists(seed, shadow_strength=s / 100),
            "labels grain": lambda s, seed: artists(seed, grain_levels=float(s)),
            "labels jpeg": lambda s, seed: artists(seed, jpeg_quality=0 if s == LOSSLESS else s),
        },
    ),
    *_pages(
        PAINTS,
        [("paints colours", "colours off by up to, % per view", (0, 3, 6, 10, 15, 20), None)],
        {"paints colours": lambda s, seed: artists(seed, color_error_fraction=s / 100)},
    ),
    *_pages(
        PAINTED,
        [
            ("painted light", "light lost on the side away from it, %", (0, 30, 60, 75, 90), None),
            ("painted strokes", "brush's unevenness, % of the light", (0, 5, 10, 20, 30), None),
            ("painted near", "hair to skin, OKLab x 100", (20, 10, 6, 4, 3, 2, 1), None),
        ],
        {
            "painted near": lambda s, seed: painters(seed, near_equal(s / 100, seed)[0]),
            "painted light": lambda s, seed: painters(seed, soft_light=s / 100),
            "painted strokes": lambda s, seed: painters(seed, strokes=s / 100),
        },
    ),
    *_pages(
        TRAINING,
        [
            ("train views", "views", (8, 6, 5, 4, 3, 2, 1), 8),
            ("train angles", "unequal turns, by up to degrees", (0, 10, 20, 40, 80, 180), 0),
            ("train yaw", "cameras' error in yaw, ± degrees", (0, 2, 5, 10, 15, 20), 0),
            ("train one camera", "one camera's error in yaw, degrees", (0, 10, 20, 45), 0),
            ("train odd", "one drawing", ("none", "flipped", "other pose", "other shirt"), "none"),
            ("train scale", "cameras' error in scale, ± %", (0, 1, 2, 5, 10, 20), 0),
            ("train shift", "cameras' shift, % of the picture", (0, 0.5, 1, 2, 4, 8), 0),
            ("train warp", "outline warp, % of the picture", (0, 0.5, 1, 2, 4), 0),
            ("train squash", "squash or stretch per view, %", (0, 2, 5, 10, 20), 0),
            ("train ears", "ears that face the viewer, % of height", (0, 3, 5, 8, 12), 0),
            ("train gaps", "gaps painted shut, % of height", (0, 2, 4, 8, 16), 0),
            ("train line", "line width, held-out views too, px of 80", (0, 0.5, 1, 2, 4), 0),
            ("train tiny", "eyes, which alone count, % of height", (8, 4, 3, 2, 1), None),
            ("train edges", "blur of the sheet, px", (0, HARD, 0.5, 1, 2), None),
            ("train jpeg", "JPEG quality", (LOSSLESS, 90, 60, 30, 10, 5), None),
            ("train resolution", "drawings, px", (160, 120, 80, 60, 40), 80),
        ],
        {
            "train views": lambda s, seed: draw_scene(seed, views=s),
            "train angles": lambda s, seed: draw_scene(seed, yaw_jitter_deg=float(s)),
            "train yaw": lambda s, seed: changed(
                "turns", seed, lambda frame, side: misturned(frame, side * s)
            ),
            "train one camera": lambda s, seed: scenes.one_turned(s, seed),
            "train odd": lambda s, seed: scenes.one_odd(s, seed),
            "train scale": lambda s, seed: changed(
                "sizes", seed, lambda frame, side: misscaled(frame, (1 + s / 100) ** side)
            ),
            "train shift": lambda s, seed: scenes.shifted(s / 100, seed),
            "train warp": lambda s, seed: scenes.warped(float(s), seed),
            "train squash": lambda s, seed: scenes.redrawn(
                "squash", seed, lambda d, side: stretched(*d, (1 + s / 100) ** side - 1)
            ),
            "train ears": lambda s, seed: scenes.with_following_ears(s / 100, seed),
            "train gaps": lambda s, seed: scenes.redrawn(
                "gaps", seed, lambda d, _: with_gaps_closed(*d, s / 100)
            ),
            "train line": lambda s, seed: draw_scene(seed, outline_px=float(s)),
            "train tiny": lambda s, seed: scenes.with_tiny_eyes(s / 100, seed),
            "train edges": lambda s, seed: scenes.blurred(s, seed),
            "train jpeg": lambda s, seed: scenes.compressed(s, seed),
            "train resolution": lambda s, seed: with_usual_views(draw_scene(seed, cell_px=s), seed),
        },
    ),
    *_pages(
        LOOK,
        [
            ("look warp", "drawing error, % of the picture", (0, 0.5, 1, 1.5, 2), 1),
            ("look line", "line width, px of 150", (0, 0.5, 1.25, 2, 3), 1.25),
            ("look views", "views", (12, 8, 6, 5, 4, 3), 8),
            ("look yaw", "cameras' error in yaw, ± degrees", (0, 2, 5, 10, 15), 0),
        ],
        {
            "look warp": lambda s, seed: look_case(seed, warp_percent=float(s)),
            "look line": lambda s, seed: look_case(seed, outline_px=float(s)),
            "look views": lambda s, seed: look_case(seed, views=s),
            "look yaw": lambda s, seed: look_of_turned(s, seed),
        },
    ),
)
