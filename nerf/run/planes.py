"""A triplane field as pictures and numbers that a web page can read.

    planes.json           sizes, places, ranges, the decoder's and the classifier's weights, palette
    plane_xy.png, ...     features as bytes: tiles below each other, three channels (R, G, B) each
    hull.png              support as bytes (grey): layers of z, left to right, top to bottom

    feature c of a plane = low[c] + step[c] * byte,  in tile c // 3, colour c % 3
    f(x) = sum of the planes' features at x, bilinear between texels
    h = max(0, hidden.weight f + hidden.bias);  raw = out.weight h + out.bias
    density = log(1 + exp(raw[0] + density_shift)) / cell;  rgb = sigmoid(raw[1:4])
    opacity of a sample = 1 - exp(-density * min(1, support / level) * step)

A texel's column is the plane's second axis, its row the first; texel (i, j) lies at low + cell * i,
low + cell * j. Nothing is kept in alpha, which browsers multiply into colours.

Source of the idea, planes as byte pictures and the decoder apart: MERF, Reiser et al. 2023.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8

from toonset.dataset.images.picture import encode_grey_png, encode_png
from toonset.errors import BundleError
from toonset.nerf.fields.base import DENSITY_SHIFT
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.hull.hull import FULL
from toonset.nerf.run.tensors import rows_near

FILE = "planes.json"
SCHEMA, VERSION = "toonset-planes", 1
CHANNELS = 3  # of a picture that browsers keep as it is
AXES = "xyz"


def planes_files(trained: TrainedField) -> dict[str, bytes]:
    """Return the files of the layout above, by name.

    Raises:
        BundleError: the field has no planes.
    """
    field = trained.field
    if not isinstance(field, TriplaneField):
        raise BundleError(
            f"run: its field has no planes ({field.spec.kind}); train again without --field"
        )
    used = rows_near(field, trained.hull)
    sizes = [field.shape[a] * field.shape[b] for a, b in PLANES]
    files, planes = {}, []
    pairs = zip(PLANES, field.plane_images(), used.split(sizes), strict=True)
    for (a, b), image, near in pairs:
        values = image.detach().numpy()
        mask = near.view(values.shape[:2]).numpy()
        tiles, low, step = packed_plane(values, mask)
        name = f"plane_{AXES[a]}{AXES[b]}.png"
        files[name] = encode_png(tiles)
        planes.append({"picture": name, "axes": [a, b], "low": low, "step": step})
    layers, columns = packed_hull(trained.hull.support.numpy())
    files["hull.png"] = encode_grey_png(layers)
    about = _about(trained, field, planes, columns)
    return {FILE: json.dumps(about, indent=1, allow_nan=False).encode() + b"\n", **files}


def packed_plane(
    values: Float[np.ndarray, "height width channels"], used: np.ndarray, per_tile: int = CHANNELS
) -> tuple[UInt8[np.ndarray, "rows width per_tile"], list[float], list[float]]:
    """Return a plane's features as bytes, and low and step of every channel.

    Args:
        values: features.
        used: (height, width) which texels are ever read; the others become low.
        per_tile: channels.
    """
    height, width, channels = values.shape
    chosen = values[used] if used.any() else values.reshape(-1, channels)
    low = chosen.min(axis=0)
    step = np.maximum(chosen.max(axis=0) - low, 1e-12) / 255
    codes = np.where(used[..., None], ((values - low) / step + 0.5).clip(0, 255), 0)
    padded = np.pad(codes.astype(np.uint8), ((0, 0), (0, 0), (0, -channels % per_tile)))
    tiles = padded.reshape(height, width, -1, per_tile).transpose(2, 0, 1, 3)
    return tiles.reshape(-1, width, per_tile), low.tolist(), step.tolist()


def packed_hull(
    support: Float[np.ndarray, "x y z"],
) -> tuple[UInt8[np.ndarray, "height width"], int]:
    """Return the support's layers of z as one picture (row y, column x), and its columns."""
    nx, ny, nz = support.shape
    columns = max(1, min(nz, round((nz * ny / nx) ** 0.5)))
    rows = -(-nz // columns)
    codes = (support * 255 + 0.5).astype(np.uint8).transpose(2, 1, 0)
    cells = np.pad(codes, ((0, rows * columns - nz), (0, 0), (0, 0)))
    grid = cells.reshape(rows, columns, ny, nx).transpose(0, 2, 1, 3)
    return grid.reshape(rows * ny, columns * nx), columns


def _about(
    trained: TrainedField, field: TriplaneField, planes: list[dict[str, Any]], columns: int
) -> dict[str, Any]:
    hull = trained.hull
    classifier = trained.classifier
    return {
        "schema": f"{SCHEMA}/{VERSION}",
        "channels": field.spec.channels,
        "low": field.low.tolist(),
        "cell": field.cell,
        "shape": list(field.shape),
        "density_shift": DENSITY_SHIFT,
        "planes": planes,
        "decoder": {"hidden": weights_record(field.hidden), "out": weights_record(field.out)},
        "classifier": None
        if classifier is None
        else {"hidden": weights_record(classifier.hidden), "out": weights_record(classifier.out)},
        "palette": None if trained.palette is None else trained.palette.tolist(),
        "hull": {
            "picture": "hull.png",
            "low": hull.low.tolist(),
            "voxel": hull.voxel,
            "shape": list(hull.support.shape),
            "columns": columns,
            "level": FULL,
        },
        "step": trained.step,
        "samples": trained.samples,
        "k": trained.k,
    }


def weights_record(layer: torch.nn.Linear) -> dict[str, Any]:
    """Return a layer's weights and biases, six digits each."""
    digits = np.vectorize(lambda value: float(f"{value:.6g}"))
    weight, bias = layer.weight.detach().double().numpy(), layer.bias.detach().double().numpy()
    return {"weight": digits(weight).tolist(), "bias": digits(bias).tolist()}
