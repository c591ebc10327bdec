"""Small drawings and lettering beside the figures of messy sheets: straight RGBA stamps."""

from __future__ import annotations

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lab.bench.messy.figure import Rgb, Stamp, tight_window

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


FACES = ("pillow", "plain", "heavy", "slanted")
VIEW_NAMES = ("front", "3/4 front", "side", "3/4 back", "back", "3/4 back", "side", "3/4 front")
TITLES = ("Character sheet", "MODEL SHEET", "Turnaround v2", "Hero - final", "Ref. sheet #3")
NOTES = ("do not trace", "coat: matte", "hair flat shading only", "see page 2", "eyes: no glint")


def lettering(text: str, size_px: float, rgb: Rgb, face: str) -> Stamp:
    """Return a line of text, cut to its letters.

    Args:
        text: one line.
        size_px: about the height of a capital and its descender.
        rgb: sRGB.
        face: one of FACES.
    """
    covered = _pillow(text, size_px) if face == "pillow" else _opencv(text, size_px, face)
    covered = covered[tight_window(covered)]
    return np.dstack([np.full((*covered.shape, 3), rgb, np.uint8), covered])


def paragraph(lines: list[Stamp], space_px: int, *, centred: bool) -> Stamp:
    """Return lines one under the other."""
    width = max(line.shape[1] for line in lines)
    height = sum(line.shape[0] for line in lines) + space_px * (len(lines) - 1)
    block = np.zeros((height, width, 4), np.uint8)
    y = 0
    for line in lines:
        x = (width - line.shape[1]) // 2 if centred else 0
        block[y : y + line.shape[0], x : x + line.shape[1]] = line
        y += line.shape[0] + space_px
    return block


def caption(number: int, views: int, size_px: float, rgb: Rgb, rng: np.random.Generator) -> Stamp:
    """Return what an artist writes at view `number` of `views`: a side, a number or an angle."""
    named = VIEW_NAMES[round(number * 8 / views) % 8]
    style = int(rng.integers(4))
    text = (named, named.upper(), f"{number + 1}.", f"{round(number * 360 / views)} deg")[style]
    return lettering(text, size_px, rgb, str(rng.choice(FACES)))


def title_block(size_px: float, rgb: Rgb, rng: np.random.Generator) -> Stamp:
    """Return a title, or a title over notes, at times in a box."""
    face = str(rng.choice(FACES))
    lines = [lettering(str(rng.choice(TITLES)), size_px, rgb, face)]
    for note in rng.permutation(NOTES)[: rng.integers(0, 4)]:
        lines.append(lettering(str(note), max(0.4 * size_px, 9), rgb, face))
    block = paragraph(lines, max(round(0.35 * size_px), 3), centred=bool(rng.integers(2)))
    return _boxed(block, rgb, rng) if rng.random() < 0.3 else block


def signature(size_px: float, rgb: Rgb, rng: np.random.Generator) -> Stamp:
    """Return a scribbled name, or a written one."""
    if rng.random() < 0.5:
        text = str(rng.choice(["(c) 2024 M. Ito", "@inkfox", "studio nine", "A.K. 11/23"]))
        return lettering(text, size_px, rgb, str(rng.choice(FACES)))
    width, height, points = round(4 * size_px), round(1.4 * size_px), 60
    along = np.linspace(0, 1, points)
    waves = sum(np.sin(2 * np.pi * (rng.uniform(2, 7) * along + rng.random())) for _ in range(3))
    x = (0.05 + 0.9 * along) * width + 0.3 * size_px * np.sin(14 * along)
    y = height * (0.5 + 0.14 * waves)
    covered = np.zeros((height + 4, width + round(size_px)), np.uint8)
    curve = np.rint(16 * np.stack([x, y], axis=-1)).astype(np.int32)
    pen = max(round(size_px / 14), 1)
    cv2.polylines(covered, [curve[:, None]], False, 255, pen, cv2.LINE_AA, shift=4)
    return np.dstack([np.full((*covered.shape, 3), rgb, np.uint8), covered])


def faded(stamp: Stamp, share: float) -> Stamp:
    """Return a stamp seen through: a watermark."""
    alpha = np.rint(stamp[..., 3] * share).astype(np.uint8)
    return np.dstack([stamp[..., :3], alpha])


def _pillow(text: str, size_px: float) -> np.ndarray:
    font = ImageFont.load_default(size_px)
    left, top, right, bottom = font.getbbox(text)
    image = Image.new("L", (int(right - left) + 8, int(bottom - top) + 8))
    ImageDraw.Draw(image).text((4 - left, 4 - top), text, 255, font=font)
    return np.asarray(image)


def _opencv(text: str, size_px: float, face: str) -> np.ndarray:
    font = cv2.FONT_HERSHEY_COMPLEX if face == "heavy" else cv2.FONT_HERSHEY_SIMPLEX
    scale = size_px / 30
    canvas = np.zeros((int(2.5 * size_px), int(size_px * (len(text) + 3))), np.uint8)
    cv2.putText(canvas, text, (int(size_px), int(1.6 * size_px)), font, scale, 255, 2, cv2.LINE_AA)
    if face != "slanted":
        return canvas
    lean = np.array([[1, -0.25, 0.4 * size_px], [0, 1, 0]], np.float32)
    return cv2.warpAffine(canvas, lean, canvas.shape[::-1])


def _boxed(block: Stamp, rgb: Rgb, rng: np.random.Generator) -> Stamp:
    pad, pen = int(rng.integers(6, 18)), int(rng.integers(1, 4))
    boxed = np.pad(block, ((pad, pad), (pad, pad), (0, 0)))
    for edge in (boxed[:pen], boxed[-pen:], boxed[:, :pen], boxed[:, -pen:]):
        edge[...] = (*rgb, 255)
    return boxed
