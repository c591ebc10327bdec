"""What lies under the figures of a messy sheet: paper, shadows and sketched ground."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from lab.bench.messy.figure import Rgb

WHITE: Rgb = (255, 255, 255)
CONTRAST = 45  # in some channel: what a painter leaves between a figure and its ground
DARK = 110  # luma: on darker grounds black ink is hardly seen
STROKES = ("hatching", "dry strokes", "dots")
LIGHT = 170  # luma: on darker grounds pencil and coloured lines are hardly seen


def luma(rgb: Rgb) -> float:
    """Return a colour's brightness, 0 to 255 (ITU-R BT.601)."""
    return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]


def ground_colors(kind: str, rng: np.random.Generator) -> tuple[Rgb, ...]:
    """Return the sRGB that a ground is made of: one, or the two ends of a gradient."""
    if kind == "tinted":
        return (_tint(rng, float(rng.uniform(0.35, 1.0))),)
    if kind == "gradient":
        return tuple(_tint(rng, float(value)) for value in rng.uniform(0.6, 1.0, size=2))
    if kind == "vignette":
        middle = _tint(rng, float(rng.uniform(0.85, 1.0)))
        fall = float(rng.uniform(0.6, 0.88))
        return middle, _rgb(np.array(middle) * fall)
    if kind == "paper":
        return (_rgb(np.array([250, 244, 230]) * rng.uniform(0.85, 1.0)),)
    return (WHITE,)


def ground_picture(
    kind: str, colors: tuple[Rgb, ...], size_wh: tuple[int, int], rng: np.random.Generator
) -> Float[np.ndarray, "height width 3"]:
    """Return the empty sheet, 0 to 255."""
    width, height = size_wh
    x, y = np.linspace(-1, 1, width), np.linspace(-1, 1, height)[:, None]
    if kind == "gradient":
        angle = float(rng.choice([0, np.pi / 2, rng.uniform(0, np.pi)]))
        along = x * np.cos(angle) + y * np.sin(angle)
        share = (along - along.min()) / np.ptp(along)
    elif kind == "vignette":
        share = np.clip((x**2 + y**2) / 2, 0, 1) ** float(rng.uniform(0.8, 1.6))
    else:
        share = np.zeros((height, width))
    ends = np.array(colors, np.float32)
    picture = ends[0] + share[..., None].astype(np.float32) * (ends[-1] - ends[0])
    if kind == "paper":
        picture += _grain(size_wh, rng)[..., None]
    return np.clip(picture, 0, 255)


def clothes(ground: tuple[Rgb, ...], outlined: bool, rng: np.random.Generator) -> tuple[Rgb, ...]:
    """Return colours of skin, hair, shirt, trousers, shoes and extras.

    Without a black line that is seen, every colour keeps a distance from the ground's; with one, a
    shirt may be as white as the paper.
    """
    seen = outlined and min(map(luma, ground)) >= DARK
    found: list[Rgb] = []
    while len(found) < 6:
        skin = not found
        hue = rng.uniform(0.03, 0.1) if skin else rng.random()
        saturation = rng.uniform(0.2, 0.6) if skin else rng.choice([0, rng.uniform(0.3, 0.95)])
        value = rng.uniform(0.4, 1.0) if skin else rng.choice([rng.uniform(0.12, 1.0), 1.0])
        rgb = _rgb(255 * np.array(colorsys.hsv_to_rgb(hue, saturation, value)))
        apart = min(int(np.abs(np.subtract(rgb, other)).max()) for other in (*ground, *found))
        if apart >= CONTRAST or (seen and rgb not in found):
            found.append(rgb)
    return tuple(found)


def shadow(
    width_px: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "height width"], tuple[int, int]]:
    """Return the darkening of a soft ellipse under feet of a width, and its centre in it (x, y)."""
    half_w = width_px * float(rng.uniform(0.45, 0.75))
    half_h = half_w * float(rng.uniform(0.18, 0.35))
    blur = half_h * float(rng.uniform(0.25, 0.8))
    pad = int(3 * blur) + 2
    size = int(2 * half_w) + 2 * pad, int(2 * half_h) + 2 * pad
    center = size[0] // 2, size[1] // 2
    layer = np.zeros((size[1], size[0]), np.float32)
    cv2.ellipse(layer, center, (int(half_w), int(half_h)), 0, 0, 360, 1.0, -1, cv2.LINE_AA)
    strength = float(rng.uniform(0.15, 0.5))
    return strength * cv2.GaussianBlur(layer, (0, 0), blur), center


def stroke_look(ground: Rgb, ink: Rgb, rng: np.random.Generator) -> tuple[str, Rgb]:
    """Return how a sheet sketches the ground, one of `STROKES`, and in which colour."""
    style = str(rng.choice(STROKES))
    warm = np.array(ground) * rng.uniform(0.6, 0.85) * np.array([1.0, 0.95, 0.88])
    return style, _rgb(warm) if style == "dry strokes" else ink


def ground_strokes(
    width_px: int, height_px: int, style: str, rgb: Rgb, rng: np.random.Generator
) -> tuple[UInt8[np.ndarray, "height width 4"], tuple[int, int]]:
    """Return a sketched shadow under feet of a width, and its centre in it (x, y).

    Args:
        width_px: of the feet.
        height_px: of the figure.
        style: one of `STROKES`: hatching, dry strokes over a wash, or a spray of dots.
        rgb: of the strokes.
        rng: of everything random.
    """
    half_w = width_px * float(rng.uniform(0.5, 0.9))
    half_h = height_px * float(rng.uniform(0.012, 0.035))
    pad = 4
    size = int(2 * half_w) + 2 * pad, int(2 * half_h) + 2 * pad
    center = size[0] // 2, size[1] // 2
    layer = np.zeros((size[1], size[0]), np.float32)
    if style == "dry strokes":
        wash = np.zeros_like(layer)
        cv2.ellipse(wash, center, (int(half_w), int(half_h)), 0, 0, 360, 1.0, -1, cv2.LINE_AA)
        layer = float(rng.uniform(0, 0.8)) * cv2.GaussianBlur(wash, (0, 0), half_h / 3)
    for _ in range(int(rng.uniform(25, 70))):
        x, y = rng.uniform(-1, 1, 2)
        x *= np.sqrt(max(1 - y * y, 0))
        long = 0.0 if style == "dots" else half_w * float(rng.uniform(0.05, 0.4))
        left, right = center[0] + half_w * x - long / 2, center[0] + half_w * x + long / 2
        row = center[1] + half_h * y
        tilt = float(rng.uniform(-0.02, 0.02)) * long
        thick = max(1, round(height_px * float(rng.uniform(0.001, 0.005))))
        stroke = np.zeros_like(layer)
        ends = (round(left), round(row - tilt)), (round(right), round(row + tilt))
        cv2.line(stroke, *ends, 1.0, thick, cv2.LINE_AA)
        layer = np.maximum(layer, float(rng.uniform(0.4, 1.0)) * np.clip(stroke, 0, 1))
    alpha = np.rint(255 * np.clip(layer, 0, 1)).astype(np.uint8)
    color = np.broadcast_to(np.array(rgb, np.uint8), (*alpha.shape, 3))
    return np.dstack([color, alpha]), center


def _tint(rng: np.random.Generator, value: float) -> Rgb:
    return _rgb(255 * np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0, 0.35), value)))


def _grain(size_wh: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Return paper: fine grain and broader clouds, a few levels each."""
    width, height = size_wh
    grain = np.zeros((height, width), np.float32)
    for step, strength in ((1, rng.uniform(1, 4)), (4, rng.uniform(1, 4)), (64, rng.uniform(0, 5))):
        size = height // step + 2, width // step + 2
        noise = rng.standard_normal(size).astype(np.float32) * np.float32(strength)
        grain += cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    return grain


def _rgb(values: np.ndarray) -> Rgb:
    red, green, blue = (int(v) for v in np.rint(np.clip(values, 0, 255)))
    return red, green, blue
