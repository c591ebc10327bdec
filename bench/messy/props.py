"""Small drawings beside the figures of messy sheets: arrows, swatches, a sword, a bag.

All are straight RGBA stamps, drawn large and reduced.
"""

from __future__ import annotations

import cv2
import numpy as np

from bench.messy.figure import Rgb, Stamp, tight_window

SAMPLES = 4
BLACK: Rgb = (20, 20, 24)
STEEL, GOLD, LEATHER, STRAP = (176, 186, 196), (214, 170, 60), (142, 92, 58), (96, 60, 40)


def arrow(width_px: int, rgb: Rgb, pen_px: float, *, curved: bool, leftwards: bool) -> Stamp:
    """Return a level or bent arrow."""
    tip = max(4 * pen_px, 0.22 * width_px)
    height = round(max(2 * tip, 0.5 * width_px if curved else 0)) + 4
    covered = np.zeros((height * SAMPLES, width_px * SAMPLES), np.uint8)
    x = np.linspace(2 * pen_px, width_px - 2 - 0.8 * tip, 24)
    share = (x - x[0]) / np.ptp(x)
    level = height - tip - 2 if curved else height / 2
    sag = (level - pen_px - 1 if curved else 0) * np.sin(np.pi * share)
    line = np.stack([x, level - sag], axis=-1)
    _stroke(covered, line, pen_px)
    end, before = line[-1], line[-4]
    ahead = (end - before) / np.linalg.norm(end - before)
    aside = ahead[::-1] * (1, -1)
    head = np.stack([end + 0.8 * tip * ahead, end + 0.5 * tip * aside, end - 0.5 * tip * aside])
    cv2.fillPoly(covered, [_fixed(head)], 255)
    if leftwards:
        covered = covered[:, ::-1]
    return _tinted(covered, rgb)


def swatches(
    colors: tuple[Rgb, ...], size_px: int, rng: np.random.Generator, *, upright: bool
) -> Stamp:
    """Return a strip of colours: squares or circles, apart or touching, with or without a line."""
    apart = int(rng.choice([0, 0, size_px // 4]))
    round_ones, lined = bool(rng.integers(2)), bool(rng.integers(2))
    step = size_px + apart
    large = size_px * SAMPLES
    strip = np.zeros((large, (step * len(colors)) * SAMPLES, 4), np.float32)
    for i, rgb in enumerate(colors):
        tile = strip[:, i * step * SAMPLES : i * step * SAMPLES + large]
        patch = np.zeros((large, large), np.uint8)
        if round_ones:
            cv2.circle(patch, (large // 2, large // 2), large // 2 - 1, 255, -1)
        else:
            patch[...] = 255
        tile[...] = (*rgb, 1.0)
        tile[..., 3] = patch / 255
        if lined:
            inside = cv2.erode(patch, np.ones((3, 3)), iterations=SAMPLES, borderValue=0)
            tile[..., :3][(patch > 0) & (inside == 0)] = BLACK
    return _shrunk(strip.transpose(1, 0, 2) if upright else strip)


def sword(height_px: int, rng: np.random.Generator) -> Stamp:
    """Return a sword, upright or leaning."""
    blade = float(rng.uniform(0.035, 0.07))
    shapes: list[tuple[list[tuple[float, float]], Rgb]] = [
        ([(-blade, 0.25), (blade, 0.25), (blade, 0.92), (0, 1), (-blade, 0.92)], STEEL),
        ([(-0.03, 0.04), (0.03, 0.04), (0.03, 0.22), (-0.03, 0.22)], LEATHER),
        ([(-0.16, 0.2), (0.16, 0.2), (0.16, 0.26), (-0.16, 0.26)], GOLD),
        ([(-0.05, 0), (0.05, 0), (0.05, 0.06), (-0.05, 0.06)], GOLD),
    ]
    return _drawn(shapes, height_px, float(rng.choice([0, rng.uniform(-0.5, 0.5)])))


def bag(height_px: int, rng: np.random.Generator) -> Stamp:
    """Return a shoulder bag."""
    wide = float(rng.uniform(0.35, 0.55))
    turn = np.linspace(0, 2 * np.pi, 40)
    body = [(wide * np.cos(t), 0.32 + 0.32 * np.sin(t)) for t in turn]
    strap = [(0.8 * wide * np.cos(t), 0.5 + 0.48 * np.sin(t)) for t in turn]
    flap = [(-0.8 * wide, 0.5), (0.8 * wide, 0.5), (0.4 * wide, 0.28), (-0.4 * wide, 0.28)]
    return _drawn([(strap, STRAP), (body, LEATHER), (flap, STRAP)], height_px, 0.0)


def _drawn(
    shapes: list[tuple[list[tuple[float, float]], Rgb]], height_px: int, lean: float
) -> Stamp:
    """Return outlined shapes; coordinates are shares of the height, y up from the bottom."""
    size = round(1.5 * height_px) * SAMPLES
    layer = np.zeros((size, size, 4), np.float32)
    turn = np.array([[np.cos(lean), np.sin(lean)], [-np.sin(lean), np.cos(lean)]])
    pen = max(round(height_px * SAMPLES / 70), SAMPLES)
    for points, rgb in shapes:
        placed = (np.array(points) - (0, 0.5)) @ turn.T * (1, -1) * height_px * SAMPLES + size / 2
        corners = [np.rint(placed).astype(np.int32)]
        cv2.fillPoly(layer, corners, (*rgb, 1.0))
        cv2.polylines(layer, corners, True, (*BLACK, 1.0), pen)
    stamp = _shrunk(layer)
    return stamp[tight_window(stamp[..., 3])]


def _stroke(covered: np.ndarray, line: np.ndarray, pen_px: float) -> None:
    pen = max(round(pen_px * SAMPLES), 1)
    cv2.polylines(covered, [_fixed(line)], False, 255, pen)


def _fixed(points: np.ndarray) -> np.ndarray:
    return np.rint(points * SAMPLES).astype(np.int32)


def _tinted(covered: np.ndarray, rgb: Rgb) -> Stamp:
    layer = np.empty((*covered.shape, 4), np.float32)
    layer[...] = (*rgb, 1.0)
    layer[..., 3] = covered / 255
    return _shrunk(layer)


def _shrunk(layer: np.ndarray) -> Stamp:
    """Return a large layer (alpha 0 to 1) at its final size."""
    premultiplied = layer.copy()
    premultiplied[..., :3] *= layer[..., 3:]
    height, width = (n // SAMPLES for n in layer.shape[:2])
    small = cv2.resize(premultiplied, (width, height), interpolation=cv2.INTER_AREA)
    small[..., :3] /= np.maximum(small[..., 3:], 1e-3)
    small[..., 3] *= 255
    return np.rint(np.clip(small, 0, 255)).astype(np.uint8)
