"""Planes as pictures: a reader that knows nothing but the JSON gets the field back."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from toonset.dataset.silhouettes.bounds import Box
from toonset.errors import BundleError
from toonset.nerf.fields.base import Field
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.fields.voxel import VoxelField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.run.planes import planes_files

BOX = Box(np.array([-1.0, -0.5, 0.2]), np.array([1.0, 1.5, 1.7]))
PALETTE = np.array([[200, 40, 40], [40, 80, 200]], dtype=np.uint8)


def trained(field: Field | None = None) -> TrainedField:
    torch.manual_seed(4)
    support = torch.zeros(20, 20, 15)
    support[3:17, 4:19, 2:13] = torch.rand(14, 15, 11)
    hull = Hull(BOX.low, 0.1, support)
    return TrainedField(
        field or TriplaneField(BOX, 24, 8, 16),
        hull, 0.1, 24, PaletteClassifier(2), PALETTE, 0.0, 50,
    )  # fmt: skip


def picture(data: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(data)) as image:
        return np.array(image)


def read_at(files: dict[str, bytes], point: np.ndarray) -> tuple[float, np.ndarray]:
    """Density and colour at a point, texel by texel, as the module's docstring says."""
    about = json.loads(files["planes.json"])
    channels = about["channels"]
    total = np.zeros(channels)
    for plane in about["planes"]:
        image = picture(files[plane["picture"]])
        a, b = plane["axes"]
        rows = about["shape"][a]
        i, j = ((point[x] - about["low"][x]) / about["cell"] for x in (a, b))
        for di in (0, 1):
            for dj in (0, 1):
                row, column = int(i) + di, int(j) + dj
                weight = (1 - abs(i - row)) * (1 - abs(j - column))
                codes = [image[row + c // 3 * rows, column, c % 3] for c in range(channels)]
                total += weight * (np.array(plane["low"]) + np.array(plane["step"]) * codes)
    hidden = np.maximum(layer(about["decoder"]["hidden"], total), 0)
    raw = layer(about["decoder"]["out"], hidden)
    density = np.log1p(np.exp(raw[0] + about["density_shift"])) / about["cell"]
    return float(density), 1 / (1 + np.exp(-raw[1:]))


def layer(weights: dict[str, Any], values: np.ndarray) -> np.ndarray:
    return np.array(weights["weight"]) @ values + np.array(weights["bias"])


def test_the_field_comes_back() -> None:
    run = trained()
    files = planes_files(run)
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.7, -0.1, 0.4], [0.7, 1.3, 1.4], (20, 3))
    with torch.no_grad():
        density, rgb = run.field(torch.as_tensor(points, dtype=torch.float32))
    for point, d, color in zip(points, density.numpy(), rgb.numpy(), strict=True):
        got_density, got_color = read_at(files, point)
        assert got_density == pytest.approx(float(d), rel=0.02)
        np.testing.assert_allclose(got_color, color, atol=2 / 255)


def test_the_hull_comes_back() -> None:
    run = trained()
    files = planes_files(run)
    hull = json.loads(files["planes.json"])["hull"]
    image = picture(files["hull.png"])
    nx, ny, nz = hull["shape"]
    for z in range(nz):
        row, column = divmod(z, hull["columns"])
        layer_of = image[row * ny : (row + 1) * ny, column * nx : (column + 1) * nx].T
        np.testing.assert_allclose(layer_of / 255, run.hull.support[:, :, z], atol=0.5 / 255 + 1e-6)


def test_pictures_have_no_alpha() -> None:
    files = planes_files(trained())
    assert len(files) == 5
    assert all(
        picture(data).shape[2:] in ((), (3,)) for name, data in files.items() if "png" in name
    )


def test_a_field_without_planes_is_refused() -> None:
    with pytest.raises(BundleError, match="no planes"):
        planes_files(trained(VoxelField(BOX, 8)))
