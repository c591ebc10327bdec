"""The depth layer: 16-bit pictures that a JSON turns back into world units."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from toonset.camera import Camera
from toonset.nerf.hull.hull import Hull
from toonset.nerf.render.depth import LEVELS, DepthLevels
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field

HULL = Hull(np.array([-1.0, 0.0, -0.5]), 0.1, torch.ones(20, 30, 10))


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_levels_give_depth_back(k: float) -> None:
    cameras = [Camera.looking_at(np.array([0, 1.5, 0]), yaw, 0.2, 9, (8, 8), k=k) for yaw in (0, 1)]
    levels = DepthLevels.of(HULL, cameras)
    reach = float(np.linalg.norm(HULL.box.size)) / 2
    assert -reach <= levels.nearest < -0.5
    depth = np.linspace(levels.nearest, levels.nearest + levels.unit * (LEVELS - 1), 64)
    depth = depth.reshape(8, 8)
    depth[0, 3] = np.nan
    picture = levels.picture(depth)
    assert picture[0, 3] == 0
    assert (np.delete(picture, 3) >= 1).all()
    np.testing.assert_allclose(levels.depth(picture), depth, atol=0.51 * levels.unit)


def test_depth_files_hold_the_rendering(
    toonset: Callable[..., Any], run: Path, tmp_path: Path
) -> None:
    out = tmp_path / "turn"
    layers = ("--layer", "rgb", "--layer", "depth")
    assert toonset("render", run, "--turntable", 2, *layers, "-o", out).code == 0
    about = json.loads((out / "depth.json").read_text())
    assert about["files"] == ["000-depth.png", "001-depth.png"]
    trained = read_field(run)
    scale = DepthLevels(about["nearest"], about["unit"])
    for name, camera in zip(about["files"], turntable(trained, 2), strict=True):
        with Image.open(out / name) as image:
            found = scale.depth(np.array(image).astype(np.uint16))
        truth = render(trained, camera).depth
        assert np.isfinite(truth).sum() > 50
        np.testing.assert_allclose(found, truth, atol=0.51 * scale.unit)
