"""The page's own script recolours drawings that are shaded throughout as `render` does."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import playwright
import pytest
from jaxtyping import UInt8
from PIL import Image

from lab.bench.view.hues import left_hues
from toonset.nerf.layered_views.layered import layered
from toonset.nerf.layered_views.records import coding, layered_record
from toonset.nerf.look.drawn_view import DRAWN, DrawnView
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.ramp_recolor import recolor_shaded
from toonset.raster import erode

PAINTS = np.array([(50, 96, 160), (210, 160, 110), (60, 44, 40)], np.uint8)
NEW = (190, 120, 30), (40, 160, 70), (150, 30, 90)
SIDE = 120
PAGE = Path(__file__).parents[4] / "apps" / "web" / "viewer" / "page"
SCRIPT = """
import { readFileSync, writeFileSync } from "node:fs";
globalThis.ImageData = class {
  constructor(width, height) {
    Object.assign(this, { width, height, data: new Uint8ClampedArray(4 * width * height) });
  }
};
const { page, record, colors, coding } = JSON.parse(readFileSync("job.json", "utf8"));
const { composed } = await import(page);
const light = new Uint8ClampedArray(readFileSync("color"));
const shown = composed(record, new Uint8Array(readFileSync("maps")), light, colors, coding);
writeFileSync("shown", shown.data);
"""


@cache
def _ball() -> tuple[np.ndarray, np.ndarray]:
    """Return a ball in soft light and its paints: a band between two others, and a dark spot."""
    row, column = np.mgrid[:SIDE, :SIDE] - SIDE / 2 + 0.5
    away = np.hypot(row, column) / (0.46 * SIDE)
    light = 0.45 + 0.75 * np.clip(1 - np.hypot(row + 22, column + 18) / SIDE, 0, 1)
    paint = np.where(np.abs(row - 0.2 * column) < 17, 1, 0)
    paint[np.hypot(row + 2, column - 14) < 9] = 2
    fine = np.random.default_rng(2).normal(0, 2, (SIDE, SIDE, 1))
    color = PAINTS[paint] * (light + 0.05 * np.sin(row / 5))[..., None] + fine
    soft = color.copy()
    for shift in ((0, 1), (0, -1), (1, 0), (-1, 0)):  # as lines are smoothed in paint programs
        soft += np.roll(color, shift, (0, 1))
    alpha = ((1 - away) * 0.46 * SIDE + 0.5).clip(0, 1)
    rgba = np.dstack([soft / 5, 255 * alpha]).clip(0, 255)
    labels = np.where(alpha >= 0.5, paint, 255)
    return np.rint(rgba).astype(np.uint8), labels.astype(np.uint8)


def _shown(folder: Path, now: UInt8[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "height width 4"]:
    """Return the ball as the page shows it in other paints."""
    rgba, labels = _ball()
    rgb, alpha = rgba[..., :3].astype(np.float32) / 255, rgba[..., 3].astype(np.float32) / 255
    none = np.zeros(alpha.shape, np.float32)
    source = np.full(alpha.shape, DRAWN, np.uint8)
    whole = np.where(labels == 255, 0, labels).astype(np.uint8)
    view = DrawnView(rgb * alpha[..., None], alpha, none, whole, rgb, source)
    found = layered(view, PAINTS, None, shaded=True)
    record: dict[str, Any] = layered_record(found) or {}
    left, top, width, height = record["box"]
    (folder / "maps").write_bytes(record.pop("maps"))
    color = Image.open(io.BytesIO(record.pop("color"))).convert("RGBA")
    (folder / "color").write_bytes(color.tobytes())
    job = {
        "page": (PAGE / "compose.js").as_uri(),
        "record": {**record, "color": [0, 0]},
        "colors": {"old": PAINTS.tolist(), "now": now.tolist(), "ink": None},
        "coding": coding(),
    }
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    (folder / "show.mjs").write_text(SCRIPT, encoding="utf-8")
    subprocess.run([_node(), "show.mjs"], cwd=folder, check=True)
    shown = np.zeros((SIDE, SIDE, 4), np.uint8)
    pixels = np.frombuffer((folder / "shown").read_bytes(), np.uint8)
    shown[top : top + height, left : left + width] = pixels.reshape(height, width, 4)
    return shown


def _node() -> str:
    assert playwright.__file__ is not None
    bundled = Path(playwright.__file__).parent / "driver" / "node"
    return str(bundled) if bundled.is_file() else (shutil.which("node") or "node")


def _recolored(number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the paints with one changed, and the ball in them as `render` would have it."""
    rgba, labels = _ball()
    now = PAINTS.copy()
    now[number] = NEW[number]
    return now, recolor_shaded(rgba, labels, PAINTS, now)


def _mean_off(one: np.ndarray, other: np.ndarray, where: np.ndarray) -> float:
    return float(np.abs(one[where, :3].astype(int) - other[where, :3]).mean())


def test_unchanged_colours_are_those_of_the_drawing(tmp_path: Path) -> None:
    rgba, labels = _ball()
    shown = _shown(tmp_path, PAINTS)
    assert _mean_off(shown, rgba, labels < 255) < 4  # WebP


@pytest.mark.parametrize("number", range(3))
def test_another_paint_turns_along_its_ramp(tmp_path: Path, number: int) -> None:
    rgba, labels = _ball()
    now, wanted = _recolored(number)
    shown = _shown(tmp_path, now)
    assert _mean_off(shown, wanted, labels < 255) < 4
    found = left_hues(rgba, shown, wanted)
    assert found.judged > 150
    assert found.old <= 1  # where three paints meet
    assert found.shining == 0
    inner = erode(labels == number, 3)
    light = [oklab_from_rgb(one[inner][:, :3])[:, 0] for one in (rgba, shown)]
    ratio = oklab_from_rgb(now[number])[0] / oklab_from_rgb(PAINTS[number])[0]
    assert np.abs(light[1] - ratio * light[0]).mean() < 0.015
    others = erode(labels < 255, 1) & ~(labels == number) & ~_near(labels == number)
    plain = _shown(tmp_path, PAINTS)
    assert np.array_equal(shown[others], plain[others])


def test_what_becomes_black_is_black(tmp_path: Path) -> None:
    now = PAINTS.copy()
    now[2] = 0
    shown = _shown(tmp_path, now)
    _, labels = _ball()
    assert shown[erode(labels == 2, 3), :3].max() < 40


def _near(mask: np.ndarray) -> np.ndarray:
    return ~erode(~mask, 4)
