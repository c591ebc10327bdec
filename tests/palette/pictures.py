"""Pictures of stripes, for tests of palettes."""

import numpy as np

from toonset.palette.palette import Palette

Rgb = tuple[int, int, int]


def as_set(palette: Palette) -> set[Rgb]:
    return {color.rgb for color in palette.colors}


def opaque(rgb: np.ndarray) -> np.ndarray:
    return np.dstack([np.rint(rgb), np.full(rgb.shape[:2], 255)]).astype(np.uint8)


def block(*parts: tuple[Rgb, int]) -> np.ndarray:
    """Return a picture of full-height stripes (colour, width)."""
    return opaque(np.concatenate([np.full((40, wide, 3), color) for color, wide in parts], axis=1))


def ramp(low: float, color: Rgb, width: int = 300) -> np.ndarray:
    """Return a gradient from a share of a colour to the colour."""
    return opaque(np.linspace(low, 1.0, width)[None, :, None] * color * np.ones((40, 1, 1)))


def soft_stripes(*colors: Rgb, width: int = 12, tall: int = 60) -> np.ndarray:
    """Return stripes with one soft column of 45 : 55 between them: a blend that repeats exactly."""
    parts: list[np.ndarray] = []
    for index, color in enumerate(colors):
        if index:
            mean = np.rint(0.45 * np.array(colors[index - 1]) + 0.55 * np.array(color))
            parts.append(np.tile(mean, (tall, 1, 1)))
        parts.append(np.tile(color, (tall, width, 1)))
    return opaque(np.concatenate(parts, axis=1))
