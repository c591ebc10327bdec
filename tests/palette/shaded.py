"""A character of flat paints, perhaps with a two-tone shadow, grain and JPEG, with its truth."""

import io
from dataclasses import dataclass

import numpy as np
from PIL import Image

SKIN, TUNIC, TROUSERS, BOOTS = (226, 178, 140), (44, 58, 104), (84, 56, 38), (74, 82, 84)
EYE = (250, 250, 250)
PAINTS = (SKIN, TUNIC, TROUSERS, BOOTS)
FACTOR = (0.72, 0.70, 0.80)
# centre and half size of every part, x and y; its paint
PARTS = (
    ((70, 150), (16, 60), 2),
    ((102, 150), (16, 60), 2),
    ((66, 214), (22, 14), 3),
    ((106, 214), (22, 14), 3),
    ((86, 112), (40, 44), 1),
    ((40, 112), (12, 36), 0),
    ((132, 112), (12, 36), 0),
    ((86, 44), (40, 38), 0),
)
EYES = ((70, 46), (102, 46))


@dataclass(frozen=True)
class Drawing:
    """A picture and what it shows.

    Attributes:
        rgba: the picture.
        paint: number of every pixel's paint, 4 = eye, 255 = none.
        dark: where it lies in shadow.
    """

    rgba: np.ndarray
    paint: np.ndarray
    dark: np.ndarray


def drawings(
    *,
    shadow: bool,
    noisy: bool,
    views: int = 8,
    eyes: bool = True,
    light: int = 1,
    tunic: float = 1.0,
) -> list[Drawing]:
    """Return a character's drawings.

    Args:
        shadow: in two tones, the light on the left.
        noisy: grain and JPEG.
        views: how many; each is a little different.
        eyes: white ones on the face.
        light: -1: on the right.
        tunic: its shadow is so many times as light as the other paints'.
    """
    rng = np.random.default_rng(3)
    factors = np.tile(FACTOR, (256, 1))
    factors[1] *= tunic
    return [
        _drawing(rng, factors, shadow=shadow, noisy=noisy, eyes=eyes, light=light)
        for _ in range(views)
    ]


def _drawing(
    rng: np.random.Generator,
    factors: np.ndarray,
    *,
    shadow: bool,
    noisy: bool,
    eyes: bool,
    light: int,
) -> Drawing:
    y, x = np.mgrid[:240, :172] + 0.5
    paint = np.full(y.shape, 255, dtype=np.uint8)
    dark = np.zeros(y.shape, dtype=bool)
    for (cx, cy), (rx, ry), number in PARTS:
        across, down = (x - cx) / (rx * rng.uniform(0.95, 1.05)), (y - cy) / ry
        inside = across**2 + down**2 < 1
        paint[inside] = number
        dark[inside] = (light * across + 0.4 * down > rng.uniform(0.1, 0.4))[inside] & shadow
    for cx, cy in EYES if eyes else ():
        paint[((x - cx) / 6) ** 2 + ((y - cy) / 8) ** 2 < 1] = 4
    table = np.array([*PAINTS, EYE, *([(255, 255, 255)] * 251)], dtype=np.float64)
    rgb = table[paint] * np.where(dark[..., None], factors[paint], 1)
    alpha = np.where(paint < 255, 255, 0).astype(np.uint8)
    if noisy:
        rgb += rng.normal(0, 3, (*y.shape, 1))
        buffer = io.BytesIO()
        Image.fromarray(rgb.clip(0, 255).astype(np.uint8)).save(buffer, "JPEG", quality=88)
        rgb = np.asarray(Image.open(buffer)).astype(np.float64)
    return Drawing(np.dstack([np.rint(rgb), alpha]).astype(np.uint8), paint, dark)
