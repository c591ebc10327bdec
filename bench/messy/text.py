"""Lettering on messy sheets: captions, titles, notes, signatures; straight RGBA stamps."""

from __future__ import annotations

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from bench.messy.figure import Rgb, Stamp, tight_window

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
