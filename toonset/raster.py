"""Grow, shrink and measure masks on the pixel grid: every stage's morphology and distances."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

ROW, MOST_ROWS = 64, 32766  # pixels in a row of `in_rows`; rows that OpenCV takes
BROAD = 3.0  # pixels of a smaller copy that a blur's sigma keeps
LONG_REACH = 24  # pixels, from which on OpenCV's distances are as fast

Mask = Bool[np.ndarray, "height width"]
Places = Int[np.ndarray, "height width"]


def dilate(mask: Mask, by: int = 1) -> Mask:
    """Return the pixels within `by` pixels of a mask, diagonals included."""
    return cv2.dilate(mask.view(np.uint8), _square(by)).view(np.bool_)


def erode(mask: Mask, by: int = 1) -> Mask:
    """Return a mask's pixels farther than `by` from its outside; beyond the picture is outside."""
    return cv2.erode(mask.view(np.uint8), _square(by), borderValue=0).view(np.bool_)


def wider_than(mask: Mask, by: int) -> Mask:
    """Return a mask's parts that are wider than twice `by` pixels (morphological opening)."""
    return dilate(erode(mask, by), by) & mask


def is_uniform(values: Shaped[np.ndarray, "height width"]) -> Mask:
    """Return where a pixel and its eight neighbours have one value, of 16 bits at most."""
    small = values.astype(np.int16, copy=False)
    return np.asarray(cv2.erode(small, _square(1)) == cv2.dilate(small, _square(1)))


def median_inside(levels: Shaped[np.ndarray, "height width"], mask: Mask) -> float:
    """Return the median of the values in a mask, bytes or unsigned 16-bit numbers; it is not empty.

    They are counted, not sorted: no copy of a large picture is made. Of more than 2**24 equal
    values the count is rounded, as OpenCV keeps it in 32-bit floats.
    """
    kinds = int(levels.max()) + 1
    counts = cv2.calcHist([levels], [0], mask.view(np.uint8), [kinds], [0, kinds])
    up_to = np.cumsum(counts, dtype=np.float64)
    middle = [np.floor((up_to[-1] - 1) / 2), np.floor(up_to[-1] / 2)]
    return float(np.searchsorted(up_to, middle, side="right").mean())


def distance_to(marked: Mask) -> Float[np.ndarray, "height width"]:
    """Return every pixel's distance to the nearest marked one, inf without any.

    OpenCV's last digits depend on where an array lies in memory; squares of distances are whole.
    """
    if not marked.any():
        return np.full(marked.shape, np.inf)
    apart = (~marked).astype(np.uint8)
    found = cv2.distanceTransform(apart, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.sqrt(np.rint(np.square(found, dtype=np.float64)))


def quick_distance_to(marked: Mask) -> Float[np.ndarray, "height width"]:
    """Return `distance_to` within 2 %, in a quarter of the time; very large without any."""
    return cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)


def quick_depth_inside(mask: Mask) -> Float[np.ndarray, "height width"]:
    """Return `quick_distance_to` the outside of a mask; beyond the picture is outside."""
    return quick_distance_to(np.pad(~mask, 1, constant_values=True))[1:-1, 1:-1]


def signed_distance(mask: Mask) -> Float[np.ndarray, "height width"]:
    """Return the distance to a mask's outline, > 0 inside, by `quick_distance_to`.

    The outline lies half a pixel before the first centre of the other kind.
    """
    return np.where(mask, quick_distance_to(~mask) - 0.5, 0.5 - quick_distance_to(mask))


def depth_inside(mask: Mask) -> Float[np.ndarray, "height width"]:
    """Return how far inside a mask every pixel's centre lies; beyond the picture is outside."""
    return distance_to(np.pad(~mask, 1, constant_values=True))[1:-1, 1:-1] - 0.5


def depth_near_edge(mask: Mask, reach: int) -> Float[np.ndarray, "height width"]:
    """Return `depth_inside` up to `reach` pixels, and that of `reach` farther in.

    For lines along an edge: exact, by whole numbers, and faster as long as `reach` is short.
    """
    if reach > LONG_REACH:
        return depth_inside(mask).astype(np.float32)
    inside = np.pad(mask, 1).view(np.uint8)
    across, row = inside.copy(), np.ones((1, 3), np.uint8)
    for _ in range(reach - 1):
        inside = cv2.erode(inside, row, borderValue=0)
        across += inside
    square = across.astype(np.uint16)
    square *= square
    found = square.copy()
    for by in range(1, reach + 1):
        away = square + np.uint16(by * by)
        for here, there in ((slice(by, None), slice(-by)), (slice(-by), slice(by, None))):
            np.minimum(found[here], away[there], out=found[here])
    return np.sqrt(found[1:-1, 1:-1], dtype=np.float32) - np.float32(0.5)


def broad_blur(
    picture: Float[np.ndarray, "height width *channels"], sigma: float
) -> Float[np.ndarray, "height width *channels"]:
    """Return a Gaussian blur, of a smaller copy where sigma is several pixels: about the same."""
    step = max(1, int(sigma / BROAD))
    height, width = picture.shape[:2]
    size = (-(-width // step), -(-height // step))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if step > 1 else picture
    small = cv2.GaussianBlur(small, (0, 0), sigma / step)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)


def nearest(
    marked: Mask,
) -> tuple[Int[np.ndarray, "height width"], Int[np.ndarray, "height width"]]:
    """Return row and column of the marked pixel nearest to every pixel; some must be marked."""
    from scipy.ndimage import distance_transform_edt

    places = distance_transform_edt(~marked, return_distances=False, return_indices=True)
    rows, columns = np.asarray(places)
    return rows, columns


def in_rows(pixels: Int[np.ndarray, " n"]) -> Int[np.ndarray, "rows columns"]:
    """Return numbers of pixels in rows, as OpenCV's `remap` takes them; the last is repeated."""
    if not len(pixels):
        return pixels.reshape(0, ROW)
    row = max(ROW, -(-len(pixels) // MOST_ROWS))
    return np.pad(pixels, (0, -len(pixels) % row), mode="edge").reshape(-1, row)


def taken(
    picture: Shaped[np.ndarray, "height width *bands"], at: tuple[Places, Places]
) -> Shaped[np.ndarray, "height width *bands"]:
    """Return `picture[at]`, rows and columns of the picture, several times as fast."""
    rows, columns = at
    height, width = picture.shape[:2]
    flat = picture.reshape(height * width, *picture.shape[2:])
    return flat.take(rows * np.int64(width) + columns, axis=0)


def from_nearest(
    values: Shaped[np.ndarray, "height width *bands"], known: Mask
) -> Shaped[np.ndarray, "height width *bands"]:
    """Return every pixel's value at the nearest known pixel; some must be known.

    Half the time of `nearest`, whose distances are exact.
    """
    labelled = cv2.distanceTransformWithLabels(
        (~known).view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    source = np.asarray(labelled[1], dtype=np.int32)
    of_source = np.zeros((int(source.max()) + 1, *values.shape[2:]), dtype=values.dtype)
    of_source[source[known]] = values[known]
    return np.asarray(of_source[source])


def connected_to(seeds: Mask, free: Mask, connectivity: int = 4) -> Mask:
    """Return the free pixels that are connected to a free seed through free pixels."""
    numbers = parts(free, connectivity)
    touched = np.zeros(int(numbers.max(initial=0)) + 1, dtype=bool)
    touched[numbers[seeds]] = True
    touched[0] = False
    return np.asarray(touched[numbers])


def parts_mostly_in(marked: Mask, place: Mask) -> Mask:
    """Return the connected parts of a mask of which more than half lies in a place."""
    numbers, areas = sized_parts(marked)
    inside = np.bincount(numbers[marked & place], minlength=len(areas))
    return marked & (inside > 0.5 * areas)[numbers]


def parts(marked: Mask, connectivity: int = 8) -> Places:
    """Return the number of the connected part, from 1, of every marked pixel; 0 elsewhere."""
    _, numbers = cv2.connectedComponents(marked.astype(np.uint8), connectivity=connectivity)
    return np.asarray(numbers, dtype=np.int64)


def sized_parts(marked: Mask, connectivity: int = 8) -> tuple[Places, Int[np.ndarray, " parts"]]:
    """Return the number of every pixel's connected part, from 1, 0 where unmarked; and the areas.

    Areas are summed run by run: OpenCV's statistics take three times as long as the parts.
    """
    count, numbers = cv2.connectedComponents(marked.view(np.uint8), connectivity=connectivity)
    if count <= 2:  # one part, or none
        area = np.count_nonzero(marked)
        return numbers, np.array([marked.size - area, area][:count])
    flat = numbers.ravel()
    starts = np.flatnonzero(np.concatenate([[True], flat[1:] != flat[:-1]]))
    lengths = np.diff(starts, append=len(flat))
    return numbers, np.bincount(flat[starts], lengths, count).astype(np.int64)


def _square(by: int) -> np.ndarray:
    return np.ones((2 * by + 1, 2 * by + 1), np.uint8)
