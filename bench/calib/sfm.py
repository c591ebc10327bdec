"""The baseline from photographs: COLMAP's structure from motion on the drawings alone.

It gets no mannequin, but its best chance otherwise: upscaled drawings, thresholds far below its
defaults, drawings taken to share one camera, a known far focal length as well as a free one,
incremental and global mapping. It has no world frame, so the rotation that fits the true cameras
best is applied before errors are measured.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import rotation_distance
from toonset.dataset.images.picture import encode_png
from toonset.dataset.split.background import flattened
from toonset.view import View
from toonset.write import write_bytes, write_json

ROOT = Path(__file__).parents[2]
MARGIN = 0.1  # of the largest drawing: features at the outline need ground around them
TIMEOUT_S = 600.0
REVERSED = np.diag([1.0, 1.0, -1.0])
Rotations = Mapping[int, Float[np.ndarray, "3 3"]]


@dataclass(frozen=True)
class SfmOptions:
    """How COLMAP is run.

    Attributes:
        height_px: smaller pictures are enlarged to this height; 0 = as drawn.
        permissive: thresholds for few and doubtful matches instead of COLMAP's defaults.
        focal_heights: fixed focal length in picture heights; 0 = estimated.
        mapper: "incremental" or "global" (GLOMAP).
    """

    height_px: int = 1000
    permissive: bool = True
    focal_heights: float = 0.0
    mapper: str = "incremental"


METHODS: dict[str, SfmOptions] = {
    "COLMAP": SfmOptions(height_px=0, permissive=False),
    "COLMAP 1000 px": SfmOptions(),
    "COLMAP 1000 px, far": SfmOptions(focal_heights=100.0),
    "COLMAP 1000 px, global": SfmOptions(mapper="global"),
}


@dataclass(frozen=True, eq=False)
class SfmResult:
    """What COLMAP made of a sheet.

    Attributes:
        rotations: camera_from_world of the largest model, by index of the view; its own world.
        points: of that model.
        seconds: wall time with its start.
        failed: why there is no result, e.g. a crash; empty where COLMAP ran to its end.
    """

    rotations: Rotations
    points: int
    seconds: float
    failed: str = ""


def reconstruct(
    views: Sequence[View], options: SfmOptions, seed: int, timeout_s: float = TIMEOUT_S
) -> SfmResult:
    """Return COLMAP's cameras of the drawings; a process of its own survives its crashes."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="toonset-sfm-") as name:
        folder = Path(name)
        for i, picture in enumerate(pictures(views, options.height_px)):
            write_bytes(folder / "images" / f"{i:03d}.png", encode_png(picture))
        write_json(folder / "request.json", {**asdict(options), "seed": seed})
        failed = _run(folder, timeout_s)
        answer: dict[str, Any] = {"rotations": {}, "points": 0}
        if not failed:
            answer = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    rotations = {int(i): np.array(r) for i, r in answer["rotations"].items()}
    return SfmResult(rotations, answer["points"], time.perf_counter() - start, failed)


def pictures(views: Sequence[View], height_px: int) -> list[UInt8[np.ndarray, "height width 3"]]:
    """Return the drawings over white in the middle of equal canvases, as one camera sees them."""
    sizes = np.array([view.rgba.shape[:2] for view in views]).max(axis=0)
    height, width = (int(n) for n in sizes + 2 * math.ceil(MARGIN * sizes.max()))
    factor = max(1.0, height_px / height)
    canvases = []
    for view in views:
        canvas = np.full((height, width, 3), 255, dtype=np.uint8)
        h, w = view.rgba.shape[:2]
        top, left = (height - h) // 2, (width - w) // 2
        canvas[top : top + h, left : left + w] = flattened(view.rgba)[..., :3]
        large = cv2.resize(canvas, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        canvases.append(np.asarray(large, dtype=np.uint8))
    return canvases


def aligned_errors(
    rotations: Rotations, truth: Float[np.ndarray, "views 3 3"]
) -> tuple[list[float], list[float]]:
    """Return each view's rotation error in radians, and the same modulo depth reversal.

    Both after the rotation of the world that leaves the least mean error: the least-squares one, or
    one that makes a single view exact, so that stray views do not spoil the others. Under
    orthography every structure has a reversed twin (Necker's cube); the second list is that of the
    better of the two.

    Source: Arun, Huang, Blostein 1987 for least squares.
    """
    if not rotations:
        return [], []
    plain = _errors(rotations, truth)
    twin = _errors({i: REVERSED @ r @ REVERSED for i, r in rotations.items()}, truth)
    return plain, min(plain, twin, key=lambda errors: float(np.mean(errors)))


def _errors(rotations: Rotations, truth: Float[np.ndarray, "views 3 3"]) -> list[float]:
    exact_for_one = [r.T @ truth[i] for i, r in rotations.items()]
    u, _, vt = np.linalg.svd(np.sum(exact_for_one, axis=0))
    worlds = [u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt, *exact_for_one]
    found = sorted(rotations.items())
    errors = [[rotation_distance(r @ world, truth[i]) for i, r in found] for world in worlds]
    return min(errors, key=lambda values: float(np.mean(values)))


def _run(folder: Path, timeout_s: float) -> str:
    """Run COLMAP on the folder; return why there is no answer, or nothing."""
    command = [sys.executable, "-m", "bench.calib.sfm_process", str(folder)]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired:
        return f"not done after {timeout_s:.0f} s"
    if done.returncode == 0:
        return ""
    lines = done.stderr.decode(errors="replace").strip().splitlines()
    return f"exit code {done.returncode}: {lines[-1] if lines else 'no message'}"
