"""Parts of a view that change little if they take the colour beside them do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Int
from skimage.measure import label

from toonset.nerf.render.shares import CRUMB, NONE, Color, Colors, Labels, Shares
from toonset.raster import dilate

ROUNDS = 8  # of taking crumbs away


def without_crumbs(shares: Shares, colors: Colors, color: Color) -> Shares:
    """Return shares without parts that might as well have the colour of a larger part beside."""
    for _ in range(ROUNDS):
        labels = shares.labels
        numbers: Labels = np.asarray(label(labels, background=NONE, connectivity=1))
        count = int(numbers.max())
        beside = _beside(numbers, count, labels, colors, color)
        there = beside[numbers] != NONE
        own, other = colors[labels[there]], colors[beside[numbers[there]]]
        more = np.linalg.norm(color[there] - other, axis=-1)
        more -= np.linalg.norm(color[there] - own, axis=-1)
        crumb = (np.bincount(numbers[there], more, count + 1) < CRUMB) & (beside != NONE)
        if not crumb.any():
            break
        gone, new = crumb[numbers], beside[numbers]
        first, second = (np.where(gone, new, old) for old in (shares.first, shares.second))
        shares = _supported(replace(shares, first=first, second=second), len(colors))
    return shares


def _beside(
    numbers: Labels, count: int, labels: Labels, colors: Colors, color: Color
) -> Int[np.ndarray, " parts"]:
    """Return the colour of the larger part beside each that is most like it; NONE without one."""
    area = np.bincount(numbers.ravel(), minlength=count + 1)
    sums = [np.bincount(numbers.ravel(), color[..., c].ravel(), count + 1) for c in range(3)]
    means = np.stack(sums, axis=1) / np.maximum(area, 1)[:, None]
    codes = []
    for left, right in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        for one, other in ((left, right), (right, left)):
            a, b = numbers[one], numbers[other]
            larger = (area[b] > area[a]) | ((area[b] == area[a]) & (b > a))
            meet = larger & (a > 0) & (b > 0)
            codes.append(a[meet].astype(np.int64) * len(colors) + labels[other][meet])
    own, near = np.divmod(np.unique(np.concatenate(codes)), len(colors))
    order = np.lexsort([np.linalg.norm(means[own] - colors[near], axis=1), own])
    kinds, firsts = np.unique(own[order], return_index=True)
    beside = np.full(count + 1, NONE)
    beside[kinds] = near[order[firsts]]
    return beside


def _supported(shares: Shares, colors: int) -> Shares:
    """Return shares without those of colours that no pixel beside shows most of."""
    labels = shares.labels
    first_ok, second_ok = (np.zeros(labels.shape, dtype=bool) for _ in range(2))
    for k in range(colors):
        near = dilate(labels == k)
        first_ok |= near & (shares.first == k)
        second_ok |= near & (shares.second == k)
    first = np.where(first_ok | ~second_ok, shares.first, shares.second)
    return replace(shares, first=first, second=np.where(second_ok, shares.second, first))
