"""Compute what a cut through a patch crosses: paint, lines, edges, and where it would begin.

Two figures that touch meet in a cleft: a right cut begins and ends where the background is a sharp
corner (the minima rule), a cut through a limb on a straight side.
Source: D. Hoffman, W. Richards, "Parts of recognition" (1984).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.raster import erode

MOST_ROWS = 320  # of the picture on which cuts are sought
LINE = 0.9  # of the cost of paint that a drawn line saves
EDGE = 0.7  # of the same that an edge between colours saves
GAP = 0.1  # of the cost of paint: paper that is enclosed
STRONG_LINE = 60.0  # levels that a line is darker than what it divides
STRONG_EDGE = 20.0  # levels of Lab over a pixel
WIDEST_LINE = 0.03  # of the height
NEARBY = 0.012  # of the height: how far the surroundings of a place reach
CLEFT, STRAIGHT = 0.25, 0.5  # of its surroundings that are background
TOLL = 0.015  # of the height: cost of a cut that begins at a straight side


@dataclass(frozen=True, eq=False)
class CutCosts:
    """A patch on a small picture.

    Attributes:
        solid: share of every cell in the patch, what it encloses included.
        drawn: the same without enclosed paper.
        lines: how much of a dark line is there, 0 to 1.
        edges: the same of an edge between colours.
        open: how little of a cleft a place is, 0 in it, 1 at a straight side.
    """

    solid: Float[np.ndarray, "height width"]
    drawn: Float[np.ndarray, "height width"]
    lines: Float[np.ndarray, "height width"]
    edges: Float[np.ndarray, "height width"]
    open: Float[np.ndarray, "height width"]

    def prices(self) -> Float[np.ndarray, "3 height width"]:
        """Return a cut's costs per cell: from cleft to cleft along lines, or edges; plainly."""
        tolls = self._tolls()
        costs = self.by_lines() + tolls, self.by_edges() + tolls, self.drawn
        return np.stack(costs) + self.gaps()

    def gaps(self) -> Float[np.ndarray, "height width"]:
        """Return the cost of enclosed paper per cell."""
        gaps: np.ndarray = GAP * np.maximum(self.solid - self.drawn, 0)
        return gaps

    def by_lines(self) -> Float[np.ndarray, "height width"]:
        """Return the cost of paint per cell if lines are cheap."""
        return self.drawn * (1 - LINE * self.lines)

    def by_edges(self) -> Float[np.ndarray, "height width"]:
        """Return the cost of paint per cell if lines and edges are cheap."""
        return self.drawn * (1 - np.maximum(LINE * self.lines, EDGE * self.edges))

    def _tolls(self) -> Float[np.ndarray, "height width"]:
        inside = self.drawn > 0.5
        return TOLL * len(inside) * np.minimum(self.open, 1) * (inside & ~erode(inside))


def look_at(
    mask: Bool[np.ndarray, "height width"],
    paint: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> CutCosts:
    """Return a patch as cuts see it, at most `MOST_ROWS` high."""
    shrink = min(1.0, MOST_ROWS / len(mask))
    size = max(8, round(mask.shape[1] * shrink)), max(8, round(mask.shape[0] * shrink))
    solid, drawn, lines, edges = (
        cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        for picture in (mask, paint, _lines(rgb), _edges(rgb))
    )
    return CutCosts(solid, drawn, lines, edges, _openness(drawn > 0.5))


def _openness(inside: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    reach = max(1.5, NEARBY * len(inside))
    near = cv2.GaussianBlur(
        inside.astype(np.float32), (0, 0), reach, borderType=cv2.BORDER_CONSTANT
    )
    return np.clip((1 - near - CLEFT) / (STRAIGHT - CLEFT), 0, 1.5)


def _lines(rgb: UInt8[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width"]:
    """Return where thin dark lines are, 0 to 1: what closing the dark away takes away."""
    luma = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
    width = max(5, round(WIDEST_LINE * len(rgb))) | 1
    lines = cv2.morphologyEx(luma, cv2.MORPH_BLACKHAT, np.ones((width, width), np.uint8))
    return np.clip(lines.astype(np.float32) / STRONG_LINE, 0, 1)


def _edges(rgb: UInt8[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width"]:
    """Return where colours change, 0 to 1."""
    lab = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2LAB).astype(np.float32)
    across = cv2.Sobel(lab, cv2.CV_32F, 1, 0, scale=0.25)
    down = cv2.Sobel(lab, cv2.CV_32F, 0, 1, scale=0.25)
    return np.clip(np.hypot(across, down).max(axis=-1) / STRONG_EDGE, 0, 1)
