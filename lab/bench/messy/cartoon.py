"""Flat cartoon figures for messy sheets, drawn from balls and limbs back to front.

Every part is a convex outline filled with one colour and stroked with the pen, as in a vector
program; parts stand in space, so that a figure can be drawn from any side. Lengths are shares of
the figure's height, +Y up from the ground, +Z towards the front, +X its left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from lab.bench.messy.figure import Cast, Figure, Rgb, cut_figure
from toonset.view import straight

SAMPLES = 4  # per pixel and axis
FLOAT_GAPS = (0.04, 0.08)  # over the head, to a hat in the air
INNER_PEN = 0.7  # of the contour's width: face lines
ROUND = np.linspace(0, 2 * math.pi, 48, endpoint=False)
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Ball:
    """An ellipsoid; `group` is "head", "body" or "face" (flat on the head, in front only)."""

    at: Point
    radii: Point
    color: Rgb
    group: str = "body"


@dataclass(frozen=True)
class Limb:
    """The hull of two balls."""

    a: Point
    b: Point
    radius_a: float
    radius_b: float
    color: Rgb
    group: str = "body"


Part = Ball | Limb


def cartoon_cast(
    number: int,
    views: int,
    figure_px: int,
    outline_px: float,
    colors: tuple[Rgb, ...],
    *,
    floats: bool,
    heads: bool,
) -> Cast:
    """Return a flat cartoon character's turnaround.

    Args:
        number: which character.
        views: drawings, at even turns.
        figure_px: about how tall they are.
        outline_px: width of the contour line, 0 = none.
        colors: sRGB of skin, hair, shirt, trousers, shoes and extras.
        floats: hat and hands hang in the air.
        heads: draw heads alone, too.
    """
    parts = _character(np.random.default_rng(number), colors, floats)
    head = [part for part in parts if part.group != "body"]
    yaws = [2 * math.pi * i / views for i in range(views)]
    return Cast(
        tuple(_drawn(parts, yaw, figure_px, outline_px) for yaw in yaws),
        tuple(_drawn(head, yaw, 1.6 * figure_px, outline_px) for yaw in yaws[:3] if heads),
        tuple(dict.fromkeys(colors)),
        outline_px,
    )


def _character(rng: np.random.Generator, colors: tuple[Rgb, ...], floats: bool) -> tuple[Part, ...]:
    skin, hair, shirt, trousers, shoes, extra = colors[:6]
    radius = float(rng.uniform(0.1, 0.19))
    hip = float(rng.uniform(0.26, 0.42))
    head_y, shoulder = 1 - 1.25 * radius, 1 - 2.3 * radius
    width = float(rng.uniform(0.08, 0.15))
    return (
        *_head(rng, (skin, hair, extra), radius, head_y, floats),
        *_trunk(rng, (shirt, trousers), width, hip, shoulder),
        *_legs((trousers, shoes), width, hip),
        *_arms(rng, (shirt, skin), width, shoulder, floats),
    )


def _head(
    rng: np.random.Generator, colors: tuple[Rgb, Rgb, Rgb], r: float, y: float, floats: bool
) -> list[Part]:
    skin, hair, extra = colors
    parts: list[Part] = [
        Ball((0, y, 0), (r, r * 1.05, r * 0.95), skin, "head"),
        Ball((0, y + 0.22 * r, -0.3 * r), (1.12 * r, 1.02 * r, r), hair, "head"),
        Ball((0, y - 0.15 * r, r), (0.12 * r, 0.14 * r, 0.1 * r), skin, "head"),
    ]
    black = (25, 22, 30)
    for side in (-1, 1):
        eye = (0.14 * r, rng.uniform(0.14, 0.3) * r, 0.1 * r)
        parts.append(Ball((side * 0.4 * r, y, 0.86 * r), eye, black, "face"))
    parts.append(Ball((0, y - 0.5 * r, 0.83 * r), (0.3 * r, 0.06 * r, 0.1 * r), black, "face"))
    spiky = rng.random() < 0.5
    if spiky:
        for angle in np.linspace(-1.2, 1.2, 5):  # a spiky fringe
            tip = (1.45 * r * math.sin(angle), y + 1.4 * r * math.cos(angle), -0.1 * r)
            root = (0.7 * r * math.sin(angle), y + 0.8 * r * math.cos(angle), -0.1 * r)
            parts.append(Limb(root, tip, 0.35 * r, 0.04 * r, hair, "head"))
    if floats or rng.random() < 0.35:
        crown = y + (1.44 if spiky else 1.24) * r
        lift = crown + 0.5 * r + rng.uniform(*FLOAT_GAPS) if floats else y + 0.85 * r
        parts.append(
            Limb((-1.1 * r, lift, 0), (1.1 * r, lift, 0), 0.12 * r, 0.12 * r, extra, "head")
        )
        parts.append(Ball((0, lift + 0.1 * r, 0), (0.75 * r, 0.6 * r, 0.75 * r), extra, "head"))
    return parts


def _trunk(
    rng: np.random.Generator, colors: tuple[Rgb, Rgb], width: float, hip: float, shoulder: float
) -> list[Part]:
    shirt, trousers = colors
    skirt = float(rng.uniform(1.0, 1.9))
    return [
        Limb((0, shoulder - 0.4 * width, 0), (0, hip, 0), 0.75 * width, width, shirt),
        Ball((0, hip, 0), (width * skirt, 0.7 * width, 0.8 * width * skirt), trousers),
    ]


def _legs(colors: tuple[Rgb, Rgb], width: float, hip: float) -> list[Part]:
    trousers, shoes = colors
    parts: list[Part] = []
    for side in (-1, 1):
        x = side * 0.55 * width
        parts.append(Limb((x, hip, 0), (x, 0.05, 0), 0.4 * width, 0.3 * width, trousers))
        parts.append(Ball((x, 0.03, 0.03), (0.035, 0.03, 0.07), shoes))
    return parts


def _arms(
    rng: np.random.Generator, colors: tuple[Rgb, Rgb], width: float, shoulder: float, floats: bool
) -> list[Part]:
    shirt, skin = colors
    angle = float(rng.uniform(0.7 if floats else 0.2, 1.3))  # clear of the trunk
    length = float(rng.uniform(0.2, 0.28))
    parts: list[Part] = []
    for side in (-1, 1):
        top = (side * 0.7 * width, shoulder - 0.05, 0.0)
        end = (top[0] + side * length * math.sin(angle), top[1] - length * math.cos(angle), 0.03)
        if not floats:
            parts.append(Limb(top, end, 0.3 * width, 0.22 * width, shirt))
        parts.append(Ball(end, (0.032, 0.034, 0.032), skin))
    return parts


def _drawn(parts: Sequence[Part], yaw: float, height_px: float, outline_px: float) -> Figure:
    """Return the parts drawn from a side at a scale of `height_px` per unit, cut out."""
    scale = height_px * SAMPLES
    size = math.ceil(1.7 * height_px) * SAMPLES
    color = np.zeros((size, size, 3), np.uint8)
    fill, ink = np.zeros((size, size), np.uint8), np.zeros((size, size), np.uint8)
    for part in _back_to_front(parts, yaw):
        outline = _outline(part, yaw) * scale * (1, -1) + (size / 2, size * 0.85)
        corners = [np.rint(outline).astype(np.int32)]
        cv2.fillPoly(color, corners, part.color)
        cv2.fillPoly(fill, corners, 255)
        cv2.fillPoly(ink, corners, 255 if part.group == "face" else 0)
        pen = round(outline_px * SAMPLES * (INNER_PEN if part.group == "face" else 1))
        if pen > 0:
            cv2.polylines(ink, corners, True, 255, pen)
    return _shrunk(color, np.maximum(fill, ink), ink if outline_px > 0 else ink * 0)


def _back_to_front(parts: Sequence[Part], yaw: float) -> list[Part]:
    """Return the parts in the order of painting: what of the face is seen lies on its head."""
    face = [part for part in parts if part.group == "face" and _nearness(part, yaw) > 0]
    rest = [part for part in parts if part.group != "face"]
    return sorted(rest, key=lambda part: _nearness(part, yaw)) + face


def _nearness(part: Part, yaw: float) -> float:
    x, _, z = part.at if isinstance(part, Ball) else np.add(part.a, part.b) / 2
    return float(x * math.sin(yaw) + z * math.cos(yaw))


def _outline(part: Part, yaw: float) -> np.ndarray:
    """Return the outline in the picture plane, (points, 2), right and up."""
    if isinstance(part, Ball):
        return _ellipse(part.at, part.radii, yaw)
    ends = ((part.a, part.radius_a), (part.b, part.radius_b))
    points = np.concatenate([_ellipse(at, (r, r, r), yaw) for at, r in ends])
    return cv2.convexHull(points.astype(np.float32))[:, 0]


def _ellipse(at: Point, radii: Point, yaw: float) -> np.ndarray:
    x = at[0] * math.cos(yaw) - at[2] * math.sin(yaw)
    across = math.hypot(radii[0] * math.cos(yaw), radii[2] * math.sin(yaw))
    return np.stack([x + across * np.cos(ROUND), at[1] + radii[1] * np.sin(ROUND)], axis=-1)


def _shrunk(color: np.ndarray, covered: np.ndarray, ink: np.ndarray) -> Figure:
    """Return the picture at its final size, lines black; black where ink lies."""
    x, y, width, height = cv2.boundingRect(covered)
    window = _whole_pixels(y, height), _whole_pixels(x, width)
    alpha, lines = covered[window] / np.float32(255), ink[window] / np.float32(255)
    painted = color[window] * (alpha * (1 - lines))[..., None]
    size = alpha.shape[1] // SAMPLES, alpha.shape[0] // SAMPLES
    small = cv2.resize(np.dstack([painted, 255 * alpha]), size, interpolation=cv2.INTER_AREA)
    return cut_figure(straight(small), cv2.resize(ink[window], size, interpolation=cv2.INTER_AREA))


def _whole_pixels(start: int, length: int) -> slice:
    """Return the samples of all pixels that a stretch of samples touches."""
    return slice(start // SAMPLES * SAMPLES, -(-(start + length) // SAMPLES) * SAMPLES)
