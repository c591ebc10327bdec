"""The table of what must be known of methods to compare them with the default, by subject.

What they are run with stands in each subject's own room, by the same names; of those that are not
here nothing must be known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """Description of a method for a chart's reader.

    Attributes:
        told: what it knows more than the default; then it is shown and not compared.
        why: what is known of it where it beats the default.
    """

    told: str = ""
    why: str = ""


CLICKED = "told 12 clicked points a view; clicking is not timed"
COUNTED = "told how many colours"
CALIB = {
    "PnP, landmarks 1 % off": Entry(CLICKED),
    "PnP, landmarks 2 % off": Entry(CLICKED),
    "PnP, landmarks 4 % off": Entry(CLICKED),
    "labels": Entry("told the directions"),
    "2 starts": Entry(why="fewer starts lose 0.1 to 0.2 degrees on drawn sheets"),
    "coarse 64, fine 120": Entry(why="fewer pixels lose 0.1 to 0.2 degrees on drawn sheets"),
}
TRAIN = {
    "finest planes": Entry(why="level where drawings agree; with drawing error coarser ones win"),
    "planes of 2/3": Entry(why="the default without trials; it loses 0.3 dB on thin limbs"),
    "planes of 1/3": Entry(why="gains on bodies whose drawings disagree; eyes and mouths are lost"),
    "without palette": Entry(why="level by design: labels, not colours, are what a palette gives"),
    "without smoothing": Entry(
        why="ahead on plain bodies; 0.2 dB behind on six characters with eyes, belts and blades"
    ),
    "voxel": Entry(
        why="level on plain bodies, 0.1 to 0.3 dB behind on thin limbs, at nine times the bytes"
    ),
    "paper, hand-picked palette, 200 steps": Entry("told the palette"),
    "paper, hand-picked palette, 2000 steps": Entry("told the palette"),
}
LOOK = {
    "without paint agreement": Entry(
        why="level on bodies that are flat; on characters with faces agreement gains FLIP"
    ),
    "without flow": Entry(
        why="level on bodies that are flat; on characters with faces flow gains FLIP"
    ),
}
PALETTE = {
    "default, lines known": Entry(why="what `toonset palette` does: it looks for lines first"),
    "colorgram, true k": Entry(COUNTED),
    "k-means, true k": Entry(COUNTED),
}
LABELS = {
    "nearest colour": Entry(
        why="it marks no pixel as mixed: borders and JPEG noise get the colours of others"
    )
}
SPLIT = {"corner colour": Entry(why="on plain paper a threshold does; on everything else it fails")}
METHODS: Mapping[str, Mapping[str, Entry]] = {
    "calib": CALIB,
    "train": TRAIN,
    "look": LOOK,
    "palette": PALETTE,
    "labels": LABELS,
    "split": SPLIT,
}
