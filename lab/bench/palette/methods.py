"""Ways to find a character's colours: ours, and tools that others use.

All get the same pictures. extcolors leaves transparent pixels out itself; colorgram.py and k-means,
which cannot, are given the others only, and the true number of colours, or 8, the usual guess.
Their colours count from 5 % of these pixels on, like ours.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import UInt8

from toonset.palette.paints.extract import find_palette
from toonset.palette.paints.select import PaletteRule
from toonset.palette.pixels.ink_lines import find_contour

LEAST_SHARE = PaletteRule().min_share
GUESS = 8  # colours, where nobody knows
LINE = 128  # of 255: covered by half

RGB = tuple[int, int, int]
Images = Sequence[UInt8[np.ndarray, "_ _ 4"]]
Method = Callable[[Images, int], list[RGB]]  # pictures, true number of colours -> found ones


def ours(images: Images, _: int) -> list[RGB]:
    """Return what `find_palette` finds."""
    return [color.rgb for color in find_palette(images).colors]


def ours_with_lines(images: Images, _: int) -> list[RGB]:
    """Return what `toonset palette` finds: drawn lines are looked for first."""
    lines = [find_contour(image) >= LINE for image in images]
    return [color.rgb for color in find_palette(images, contours=lines).colors]


def extcolors(images: Images, _: int) -> list[RGB]:
    """Return what the paper's tool finds, tolerance 32."""
    from PIL import Image

    tool = importlib.import_module("extcolors")  # untyped
    pixels = np.concatenate([image.reshape(-1, 4) for image in images])
    found, _ = tool.extract_from_image(Image.fromarray(pixels[None]))
    least = LEAST_SHARE * np.count_nonzero(pixels[:, 3])
    return [rgb for rgb, count in found if count >= least]


def colorgram(count: int | None) -> Method:
    """Return colorgram.py with `count` colours; None = as many as there are."""

    def find(images: Images, true_count: int) -> list[RGB]:
        from PIL import Image

        tool = importlib.import_module("colorgram")  # untyped
        found = tool.extract(Image.fromarray(_pixels(images)[None]), count or true_count)
        return [(c.rgb.r, c.rgb.g, c.rgb.b) for c in found if c.proportion >= LEAST_SHARE]

    return find


def k_means(count: int | None, seed: int = 0) -> Method:
    """Return scikit-learn's k-means with `count` colours; None = as many as there are."""

    def find(images: Images, true_count: int) -> list[RGB]:
        tool = importlib.import_module("sklearn.cluster")  # untyped
        pixels = _pixels(images).astype(np.float32)
        fitted = tool.KMeans(count or true_count, random_state=seed).fit(pixels)
        shares = np.bincount(fitted.labels_, minlength=count or true_count) / len(pixels)
        centers = np.rint(fitted.cluster_centers_[shares >= LEAST_SHARE]).astype(int)
        return [(int(red), int(green), int(blue)) for red, green, blue in centers]

    return find


METHODS: dict[str, Method] = {
    "default": ours,
    "default, lines known": ours_with_lines,
    "extcolors": extcolors,
    "colorgram, true k": colorgram(None),
    f"colorgram, k = {GUESS}": colorgram(GUESS),
    "k-means, true k": k_means(None),
    f"k-means, k = {GUESS}": k_means(GUESS),
}


def _pixels(images: Images) -> UInt8[np.ndarray, "pixels 3"]:
    """Return the colours of all opaque pixels."""
    opaque = [image[image[..., 3] > 0][:, :3] for image in images]
    return np.ascontiguousarray(np.concatenate(opaque))
