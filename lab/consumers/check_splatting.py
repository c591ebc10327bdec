"""Check `--layout old --centre` with the COLMAP reader of 3D Gaussian splatting.

    uv venv --python 3.11 /tmp/gs && uv pip install --python /tmp/gs/bin/python gaussian-splatting
    toonset export BUNDLE --to colmap --layout old --centre -o a
    /tmp/gs/bin/python lab/consumers/check_splatting.py a

The reader keeps fields of view only, so the principal point is where the middle of the picture is.
Measured with gaussian-splatting 2.11.0 (3 bundles, 22 views): at most 0.00001 px with --centre;
without it up to 28 px on drawings of 270 px.
"""

from __future__ import annotations

import math
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from exported import pixels, points_around, read_views, report


def projected(camera: Any, points: np.ndarray) -> np.ndarray:
    """Return pixels as the rasteriser has them: two fields of view around the picture's middle."""
    local = points @ np.asarray(camera.R, float).T + np.asarray(camera.T, float)
    size = np.array([camera.image_width, camera.image_height])
    angles = np.array([camera.FoVx, camera.FoVy])
    focal = size / 2 / np.array([math.tan(angle / 2) for angle in angles])
    return focal * local[:, :2] / local[:, 2:] + size / 2


def check(folder: Path) -> bool:
    """Compare every view of a folder; all must be there."""
    reader = import_module("gaussian_splatting.dataset.colmap")
    cameras, views, off = reader.read_colmap_cameras(str(folder)), read_views(folder), []
    assert len(cameras) == len(views)
    for camera in cameras:
        view = views[Path(camera.image_path).name]
        points = points_around(view)
        expected = pixels(view, points, far_pinhole=True)
        off.append(float(np.abs(projected(camera, points) - expected).max()))
    return report(f"{folder} in gaussian-splatting", off)


if __name__ == "__main__":
    sys.exit(not all([check(Path(name)) for name in sys.argv[1:]]))
