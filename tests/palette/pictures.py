"""Pictures of stripes, for tests of palettes."""

import numpy as np

from toonset.palette.palette import Palette


def as_set(palette: Palette) -> set[tuple[int, int, int]]:
    return {color.rgb for color in palette.colors}


def block(*parts: tuple[tuple[int, int, int], int]) -> np.ndarray:
    """Return a picture of full-height stripes (colour, width)."""
    stripes = [np.full((40, width, 3), color, dtype=np.uint8) for color, width in parts]
    rgb = np.concatenate(stripes, axis=1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def soft_stripes(*colors: tuple[int, int, int], width: int = 12, tall: int = 60) -> np.ndarray:
    """Return stripes with one soft column of 45 : 55 between them: a blend that repeats exactly."""
    parts: list[np.ndarray] = []
    for index, color in enumerate(colors):
        if index:
            mean = np.rint(0.45 * np.array(colors[index - 1]) + 0.55 * np.array(color))
            parts.append(np.tile(mean.astype(np.uint8), (tall, 1, 1)))
        parts.append(np.tile(np.array(color, np.uint8), (tall, width, 1)))
    rgb = np.concatenate(parts, axis=1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])
