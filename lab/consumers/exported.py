"""What the checks of this folder share: points round a view, and where its exact camera sees them.

The checks run inside other programs' Pythons, so this needs numpy only. Each one is given folders
that `toonset export` has written, and compares the other program's pixels with toonset.json.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

LIMIT_PX = 0.01


def read_views(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the records of toonset.json by picture name."""
    views = json.loads((folder / "toonset.json").read_text())["views"]
    return {view["name"]: view for view in views}


def points_around(view: dict[str, Any]) -> np.ndarray:
    """Return 1,000 points of the ball that the picture shows (seed 5)."""
    camera = view["camera"]
    radius = max(camera["size_wh"]) / 2 / camera["scale"]
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(1000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.array(camera["target"]) + direction * radius * rng.random((1000, 1)) ** (1 / 3)


def pixels(view: dict[str, Any], points: np.ndarray, *, far_pinhole: bool) -> np.ndarray:
    """Return where the exact camera (or the far pinhole that stands for it) sees points."""
    camera = view["camera"]
    k = camera["k"] or (1 / view["pinhole_distance"] if far_pinhole else 0.0)
    local = (points - np.array(camera["target"])) @ np.array(camera["rotation"]).T
    scale = np.array([camera["scale"], camera["scale"] * camera["pixel_aspect"]])
    return np.array(camera["center"]) + scale * local[:, :2] / (1 + k * local[:, 2:])


def report(what: str, off_px: list[float]) -> bool:
    """Print the figures of one check; return whether it is within the limit."""
    passed = max(off_px) <= LIMIT_PX
    figures = f"median {np.median(off_px):.5f} p95 {np.percentile(off_px, 95):.5f}"
    verdict = "ok" if passed else "TOO FAR"
    print(f"{what}: n {len(off_px)} {figures} max {max(off_px):.5f} px  {verdict}")
    return passed
