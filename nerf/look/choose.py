"""Choose which drawing every pixel of a view shows: few, whole patches of one drawing each.

A drawing counts by its share of the view, by how squarely it saw the place and by how far the place
is from its edges. Where two count alike the seam between their patches goes where they are most
alike, and with it round what only one of them has: a minimal cut through a graph of pixels.

Sources: seams by graph cuts, Kwatra et al. 2003; Agarwala et al. 2004 ("Interactive digital
photomontage"); maximal flows, Dinic 1970 (`scipy.sparse.csgraph.maximum_flow`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.nerf.look.outline import without_crumbs
from toonset.nerf.look.places import sample_picture
from toonset.nerf.look.texture import Texture
from toonset.raster import broad_blur, dilate, in_rows, nearest, taken

EDGE = 0.02  # of the figure's height, as all lengths: so near to a drawing's edges it counts less
LEAST_TRUST = 0.1
SQUARE_ON = 0.8  # of a pixel of the drawing per pixel of the view: from here on it saw enough
SPREAD = 0.04  # sigma over which drawings are compared
OTHER = 0.1  # share of a drawing that does not flank the view
LEVEL = 2.0  # times as much as another: up to here the seam is free
EVEN = 100.0  # squares of levels, as differences of colour: a pixel of seam, e times the count
TOUCHING = 0.2  # of the smaller of two groups: those that overlap less are two things
OUTDONE, MOSTLY = 1e-6, 1e-3  # counts of others, and least one, where one drawing shows all
ISLAND = 2e-3  # of the squared height: smaller patches of one drawing tear what they lie in
ENOUGH_PX = 260  # height at which drawings are chosen well enough
LIKE = 0.2  # of a channel: colours of two drawings that are nearer than this are averaged

Mask = Bool[np.ndarray, "h w"]


@dataclass(frozen=True, eq=False)
class Look:
    """A drawing as a view's pixels see it.

    Attributes:
        texture: the drawing.
        x, y: (h, w) where every pixel's place lies in it.
        seen: (h, w) it shows the place.
        share: of the view, 0 to 1.
        scale: pixels of the view per pixel of the drawing.
        without: features of the drawing that its paint goes without; None: it has them all.
    """

    texture: Texture
    x: Float[np.ndarray, "h w"]
    y: Float[np.ndarray, "h w"]
    seen: Mask
    share: float
    scale: float
    without: Bool[np.ndarray, " features"] | None = None

    def every(self, step: int) -> Look:
        """Return the same of every `step`-th pixel and row."""
        x, y, seen = (
            np.ascontiguousarray(at[::step, ::step]) for at in (self.x, self.y, self.seen)
        )
        return Look(self.texture, x, y, seen, self.share, self.scale / step)

    def at(self, pixels: Int[np.ndarray, "rows columns"]) -> Look:
        """Return the same of some pixels, which are numbered row after row."""
        return replace(
            self, x=self.x.take(pixels), y=self.y.take(pixels), seen=self.seen.take(pixels)
        )

    def bare(self, without: Bool[np.ndarray, " features"]) -> Look:
        """Return the same, without some features in its paint."""
        return replace(self, without=without) if without.any() else self

    @cached_property
    def in_own(self) -> Float[np.ndarray, "h w 3"]:
        """Return the colours at the places in which the artist drew them, of 255."""
        places = (self.x, self.y)
        return sample_picture(self.texture.in_own, places, cv2.INTER_LINEAR).astype(np.float32)

    @cached_property
    def paint(self) -> Float[np.ndarray, "h w 3"]:
        """Return the drawing's colours at the places."""
        found = sample_picture(self.texture.paint, (self.x, self.y), cv2.INTER_CUBIC)
        if self._bare.any():
            bare = sample_picture(self.texture.features.paint, (self.x, self.y), cv2.INTER_LINEAR)
            found = cv2.copyTo(bare, self._bare.view(np.uint8), found)
        return np.clip(found, 0, 1, out=found)

    @cached_property
    def label(self) -> UInt8[np.ndarray, "h w"]:
        """Return the labels of the drawing's paint at the places."""
        own, bare = (
            sample_picture(labels, (self.x, self.y), cv2.INTER_NEAREST)
            for labels in (self.texture.labels, self.texture.features.labels)
        )
        return np.where(self._bare, bare, own)

    @cached_property
    def group(self) -> Int[np.ndarray, "h w"]:
        """Return the number of the group of features that every place lies in; 0: none."""
        groups = self.texture.features.groups
        return cv2.remap(groups, self.x, self.y, cv2.INTER_NEAREST) * self.seen

    @cached_property
    def _bare(self) -> Mask:
        if self.without is None or not self.without.any():
            return np.zeros(self.x.shape, dtype=bool)
        numbers = self.texture.features.numbers
        return np.take(self.without, sample_picture(numbers, (self.x, self.y), cv2.INTER_NEAREST))

    def trust(self, figure_px: float) -> Float[np.ndarray, "h w"]:
        """Return how well the drawing shows every place, 0 to 1."""
        edge = sample_picture(self.texture.to_edge, (self.x, self.y), cv2.INTER_LINEAR)
        inner = (edge * self.scale / (EDGE * figure_px)).clip(0, 1)
        across, down = (
            cv2.Sobel(cv2.GaussianBlur(at, (0, 0), max(0.3, EDGE / 5 * figure_px)), -1, *way)
            for at, way in ((self.x, (1, 0)), (self.y, (0, 1)))
        )
        square = (across * down * (self.scale / 8) ** 2 / SQUARE_ON).clip(0, 1)
        return (LEAST_TRUST + (1 - LEAST_TRUST) * inner) * (0.05 + 0.95 * square) * self.seen


@dataclass(frozen=True)
class Shared:
    """Groups of features that both flanking drawings have, such as a face: one shows them.

    Attributes:
        leader: 0 or 1, which of the first two drawings does.
        groups: of the first and of the second drawing.
    """

    leader: int
    groups: tuple[tuple[int, ...], tuple[int, ...]]

    def region(self, looks: Sequence[Look]) -> Mask:
        """Return the pixels of the groups."""
        first, second = (
            np.isin(look.group, its) for look, its in zip(looks, self.groups, strict=False)
        )
        return np.asarray(first | second)


def shared_groups(looks: Sequence[Look]) -> list[Shared]:
    """Return the groups of features that both flanking drawings have, and who shows them.

    It is the drawing that shows what both have less stretched, by its share of the view.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    both = (looks[0].group > 0) & (looks[1].group > 0)
    if not both.any():
        return []
    own, its = (look.group[both] for look in looks[:2])
    worth = [look.share * _fineness(look)[both] for look in looks[:2]]
    size = int(own.max()) + int(its.max()) + 2
    second = its + int(own.max()) + 1
    pairs = coo_matrix((np.ones(len(own)), (own, second)), shape=(size, size)).tocsr().tocoo()
    shown = [np.bincount(look.group.ravel(), minlength=size) for look in looks[:2]]
    least = np.minimum(shown[0][pairs.row], shown[1][pairs.col - int(own.max()) - 1])
    kept = pairs.data > TOUCHING * least
    joined = coo_matrix((pairs.data[kept], (pairs.row[kept], pairs.col[kept])), shape=(size, size))
    _, part = connected_components(joined, directed=False)
    found = []
    for number in np.unique(part[pairs.row[kept]]):
        at = (part[own] == number) & (part[second] == number)
        groups = tuple(np.unique(own[at]).tolist()), tuple(np.unique(its[at]).tolist())
        found.append(Shared(int(worth[1][at].sum() > worth[0][at].sum()), groups))
    return found


def _fineness(look: Look) -> Float[np.ndarray, "h w"]:
    """Return pixels of a drawing per pixel of the view, as fine as both are: 1 at most."""
    density = np.gradient(look.x, axis=1) * np.gradient(look.y, axis=0) * look.scale**2
    return density.clip(0, 1)


def choose(
    looks: Sequence[Look], within: Mask, figure_px: float, shared: Sequence[Shared] = ()
) -> tuple[Int[np.ndarray, "h w"], Float[np.ndarray, "looks h w"]]:
    """Return the drawing that every pixel shows, -1 where none does; and what each counts.

    Seams run through what both drawings paint alike: large figures are looked at in every second
    or third pixel, and only what a drawing does not show is told pixel by pixel.

    Args:
        looks: the nearest first.
        within: pixels of the figure, over which features go on.
        figure_px: height of the figure.
        shared: groups of features that one drawing shows.
    """
    step = max(1, int(figure_px // ENOUGH_PX))
    if step == 1:
        return _choose(looks, within, figure_px, shared)
    few = [look.every(step) for look in looks]
    chosen, counts = _choose(few, within[::step, ::step], figure_px / step, shared)
    rows, columns = within.shape
    size = (chosen.shape[1] * step, chosen.shape[0] * step)
    finer = [cv2.resize(one, size, interpolation=cv2.INTER_LINEAR) for one in counts]
    seen = np.stack([look.seen for look in looks])
    counts = (np.stack(finer)[:, :rows, :columns] + 1e-6) * seen
    chosen = np.repeat(np.repeat(chosen, step, axis=0), step, axis=1)[:rows, :columns]
    hidden = ~np.take_along_axis(seen, chosen.clip(0)[None], 0)[0] | (chosen < 0)
    return np.where(hidden & seen.any(axis=0), counts.argmax(axis=0), chosen), counts


def _choose(
    looks: Sequence[Look], within: Mask, figure_px: float, shared: Sequence[Shared]
) -> tuple[Int[np.ndarray, "h w"], Float[np.ndarray, "looks h w"]]:
    """Return what `choose` does, at the looks' own pixels."""
    trusts = [look.trust(figure_px) for look in looks]
    counts = np.stack(
        [
            broad_blur((look.share * trust).astype(np.float32), max(0.3, SPREAD * figure_px))
            * look.seen
            for look, trust in zip(looks, trusts, strict=True)
        ]
    )
    counts += 1e-6 * np.stack([look.seen for look in looks])
    for group in shared:
        shown = group.region(looks) & looks[group.leader].seen
        others = np.arange(len(looks)) != group.leader
        counts[:, shown] *= np.where(others, OUTDONE, 1)[:, None]
        counts[group.leader][shown] = np.maximum(counts[group.leader][shown], MOSTLY)
    best = np.where(counts[0] > 0, 0, -1)
    most = counts[0]
    for number in range(1, len(looks)):
        best[counts[number] > most] = number
        most = np.maximum(most, counts[number])
    best = _without_islands(best, within, ISLAND * figure_px**2)
    if len(looks) == 1:
        return best, counts
    found = best.copy()
    used = np.flatnonzero(np.bincount(best[within] + 1)[1:]).tolist()
    for one, other in combinations(used, 2):
        either = within & ((found == one) | (found == other))
        most, least = np.maximum(counts[one], counts[other]), np.minimum(counts[one], counts[other])
        free = either & (most < LEVEL * least)
        if free.any():
            _cut(found, free, (one, other), looks, counts)
    return _without_islands(found, within, ISLAND * figure_px**2), counts


def _without_islands(
    chosen: Int[np.ndarray, "h w"], within: Mask, least_px: float
) -> Int[np.ndarray, "h w"]:
    """Return a choice whose small patches show the drawing that shows what is round them."""
    small = np.zeros(chosen.shape, dtype=bool)
    for value in np.flatnonzero(np.bincount(chosen[within] + 1)) - 1:
        patches = within & (chosen == value)
        small |= patches & ~without_crumbs(patches, least_px, 0)
    if not small.any():
        return chosen
    (found,) = filled_from(within & ~small, chosen)
    return np.where(small, found, chosen)


def _cut(
    chosen: Int[np.ndarray, "h w"],
    free: Mask,
    pair: tuple[int, int],
    looks: Sequence[Look],
    counts: Float[np.ndarray, "looks h w"],
) -> None:
    """Move, in place, the seam of two drawings to where they are most alike.

    Args:
        chosen: of the drawings.
        free: pixels in which the seam may lie.
        pair: the drawings.
        looks: all drawings, told by the artist's colours: a recoloured view has the same seams.
        counts: what each counts.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    rows, columns = (np.flatnonzero(dilate(free).any(axis=axis)) for axis in (1, 0))
    box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    own, inner = chosen[box], free[box]
    node = np.where(own == pair[0], 0, np.where(own == pair[1], 1, -1))
    node[inner] = np.arange(2, 2 + np.count_nonzero(inner))
    paints = [looks[one].in_own[box] for one in pair]
    unlike = ((paints[0] - paints[1]) ** 2).sum(axis=-1)
    sides = []
    for here, there in (
        ((slice(None), slice(-1)), (slice(None), slice(1, None))),
        ((slice(-1), slice(None)), (slice(1, None), slice(None))),
    ):
        first, second = node[here], node[there]
        joined = (np.minimum(first, second) >= 0) & (np.maximum(first, second) >= 2)
        price = (unlike[here] + unlike[there] + EVEN)[joined]
        sides.append((first[joined], second[joined], price))
    ratio = EVEN * np.log(counts[pair[0]][box][inner] / counts[pair[1]][box][inner])
    sides.append((np.where(ratio > 0, 0, 1), node[inner], np.abs(ratio)))
    first, second, price = (np.concatenate(each) for each in zip(*sides, strict=True))
    both = (np.concatenate([first, second]), np.concatenate([second, first]))
    size = int(node.max()) + 1
    weights = np.concatenate([price, price]).astype(np.int32)
    graph = coo_matrix((weights, both), shape=(size, size)).tocsr()
    left = graph - maximum_flow(graph, 0, 1).flow
    left.eliminate_zeros()
    behind = np.ones(size, dtype=bool)
    behind[breadth_first_order(left, 0, return_predecessors=False)] = False
    own[inner] = np.where(behind[node[inner]], pair[1], pair[0])


def mixed(
    looks: Sequence[Look], chosen: Int[np.ndarray, "h w"], counts: Float[np.ndarray, "looks h w"]
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return the chosen drawings' colours, and their labels.

    Where another drawing has nearly the same colour both are averaged: light and the hand differ.
    """
    color = np.zeros((*chosen.shape, 3), np.float32)
    label = np.zeros(chosen.shape, np.uint8)
    at = in_rows(np.flatnonzero(chosen >= 0))
    own = chosen.take(at)
    used = [number for number in range(len(looks)) if (own == number).any()]
    few = {number: looks[number].at(at) for number in used}
    shown, name = np.zeros((*at.shape, 3), np.float32), np.zeros(at.shape, np.uint8)
    for number, look in few.items():
        here = (own == number).view(np.uint8)
        shown, name = cv2.copyTo(look.paint, here, shown), cv2.copyTo(look.label, here, name)
    total, weights = shown.copy(), np.ones(at.shape, np.float32)
    most = counts.reshape(len(looks), -1)[own, at]
    for number, look in few.items() if len(used) > 1 else ():
        red, green, blue = cv2.split(cv2.absdiff(look.paint, shown))
        like = (1 - cv2.max(cv2.max(red, green), blue) / LIKE).clip(0, 1)
        like *= own != number
        weight = like * (counts[number].take(at) / np.maximum(most, 1e-6)).clip(0, 1)
        total += weight[..., None] * look.paint
        weights += weight
    color.reshape(-1, 3)[at], label.reshape(-1)[at] = total / weights[..., None], name
    return color, label


def filled_from(marked: Mask, *pictures: np.ndarray) -> list[np.ndarray]:
    """Return pictures with every pixel taken from the nearest marked one; as they are of none."""
    if marked.all() or not marked.any():
        return [*pictures]
    at = nearest(marked)
    return [taken(picture, at) for picture in pictures]
