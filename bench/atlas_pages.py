"""The pages of the atlas beside calibration's: what training and the palette can stand."""

from __future__ import annotations

from toonset.bench import atlas_scenes as scenes
from toonset.bench.atlas_palette import PalettePage, near_equal, tiny_feature
from toonset.bench.atlas_training import TrainPage
from toonset.bench.stability_draws import HARD, LOSSLESS

PALETTE_PAGES = (
    PalettePage(
        "palette near",
        "hair's distance from skin, OKLab x 100",
        (20, 10, 6, 4, 3, 2, 1),
        (20, 4, 2),
        "Near-equal colours: hair ever more like skin; both are to be found.",
        near_equal,
    ),
    PalettePage(
        "palette tiny",
        "radius of the eyes, % of height",
        (8, 6, 4, 3, 2, 1, 0.5),
        (8, 4, 1),
        "Tiny features: eyes in a colour of their own, which is to be found.",
        tiny_feature,
    ),
)
TRAIN_PAGES = (
    TrainPage(
        "train views",
        "views",
        (8, 6, 5, 4, 3, 2, 1),
        (8, 4, 2),
        "Fewer drawings, evenly round the character.",
        scenes.numbered,
    ),
    TrainPage(
        "train angles",
        "turned off even steps by up to, degrees",
        (0, 10, 20, 40, 80, 180),
        (0, 40, 180),
        "Eight drawings turned unequally, cameras known.",
        scenes.uneven,
    ),
    TrainPage(
        "train yaw",
        "cameras' error in yaw, ± degrees",
        (0, 2, 5, 10, 15, 20),
        (0, 5, 15),
        "Cameras turned wrongly, each with a sigma as large as its error.",
        scenes.misturned,
    ),
    TrainPage(
        "train scale",
        "cameras' error in scale, ± %",
        (0, 1, 2, 5, 10, 20),
        (0, 2, 10),
        "Cameras of a wrong scale.",
        scenes.misscaled,
    ),
    TrainPage(
        "train shift",
        "cameras' shift, % of the picture",
        (0, 0.5, 1, 2, 4, 8),
        (0, 1, 4),
        "Cameras shifted in their pictures.",
        scenes.shifted,
    ),
    TrainPage(
        "train warp",
        "outline warp, % of the picture",
        (0, 0.5, 1, 2, 4),
        (0, 1, 4),
        "Drawing error: every view smoothly bent; careful hands are within 0.5 to 1.5 %.",
        scenes.warped,
    ),
    TrainPage(
        "train squash",
        "squash or stretch per view, %",
        (0, 2, 5, 10, 20),
        (0, 5, 20),
        "Exaggeration: views taller and narrower, or lower and wider.",
        scenes.squashed,
    ),
    TrainPage(
        "train ears",
        "radius of the ears, % of height",
        (0, 3, 5, 8, 12),
        (0, 5, 12),
        "Parts that follow the viewer: round ears that face us from everywhere.",
        scenes.with_following_ears,
    ),
    TrainPage(
        "train gaps",
        "gaps painted shut, % of height",
        (0, 2, 4, 8, 16),
        (0, 4, 16),
        "Holes between limbs that are painted shut.",
        scenes.with_gaps_painted,
    ),
    TrainPage(
        "train line",
        "line width, px of 80",
        (0, 0.5, 1, 2, 4),
        (0, 1, 4),
        "Contour lines, which move with the viewer; the held-out views have them, too.",
        scenes.outlined,
    ),
    TrainPage(
        "train contrast",
        "contrast between colours, %",
        (100, 50, 20, 10, 0),
        (100, 20, 0),
        "Colours ever more alike, at last a single flat one without texture.",
        scenes.paler,
    ),
    TrainPage(
        "train tiny",
        "radius of the eyes, % of height",
        (8, 4, 3, 2, 1),
        (8, 3, 1),
        "Tiny features: only the eyes' pixels are compared.",
        scenes.with_tiny_eyes,
        of_base=False,
    ),
    TrainPage(
        "train edges",
        "blur of the sheet, px",
        (0, HARD, 0.5, 1, 2),
        (0, HARD, 2),
        "Without anti-aliasing, and blurred; cut out of a white sheet.",
        scenes.blurred,
        of_base=False,
    ),
    TrainPage(
        "train jpeg",
        "JPEG quality",
        (LOSSLESS, 90, 60, 30, 10, 5),
        (LOSSLESS, 60, 10),
        "Saved as JPEG, and cut out of the white sheet.",
        scenes.compressed,
        of_base=False,
    ),
    TrainPage(
        "train resolution",
        "drawings, px",
        (160, 120, 80, 60, 40),
        (120, 80, 40),
        "Small drawings; the held-out views stay at 80 px.",
        scenes.sized,
        clean=80,
    ),
)
