"""Pack a field into model.safetensors, as small as renderings allow without change.

    field.*, classifier.*     parameters; tables in half precision, as training leaves them
    field.planes              only the rows that a point near the hull can read,
    field.planes.rows         which ones: a bit per row, most significant first
    hull                      support * 255 as bytes, x y z in C order, deflated (zlib)

Half of the planes lies beside the figure, and most of the hull is all full or all empty.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Bool, UInt8
from torch import Tensor, nn

from toonset.errors import BundleError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.train.loop import HALF_FROM

ROWS = ".rows"
COMPRESSION = 6  # 9 saves 2 % and takes five times as long
SLACK = 1e-3  # cells: where single precision may round a point to


def packed(trained: TrainedField) -> dict[str, Tensor]:
    """Pack a field into the tensors of model.safetensors."""
    result = {}
    for name, values in parameters_of(trained).items():
        result[name] = values.half() if values.numel() >= HALF_FROM else values.clone()
    if isinstance(trained.field, TriplaneField):
        used = rows_near(trained.field, trained.hull)
        result["field.planes"] = result["field.planes"][used]
        result["field.planes" + ROWS] = torch.from_numpy(np.packbits(used.numpy()))
    support = (trained.hull.support * 255).round().to(torch.uint8)
    deflated = zlib.compress(support.numpy().tobytes(), COMPRESSION)
    result["hull"] = torch.frombuffer(bytearray(deflated), dtype=torch.uint8)
    return {name: values.contiguous() for name, values in result.items()}


def unpack(found: Mapping[str, Tensor], trained: TrainedField, where: str) -> None:
    """Fill a field that was built from its record with what `packed` returned.

    Args:
        found: the tensors.
        trained: the field to fill; its hull's grid has the right shape.
        where: the file, for messages.

    Raises:
        BundleError: a tensor is missing, unknown, or has another shape, type or range.
    """
    parameters = parameters_of(trained)
    sparse = {name + ROWS for name in parameters if name + ROWS in found}
    expected = parameters.keys() | sparse | {"hull"}
    if found.keys() != expected:
        odd = ", ".join(sorted(found.keys() ^ expected))
        raise BundleError(f"{where}: tensors missing or unknown: {odd}; train again")
    for name, values in parameters.items():
        rows = _rows(found[name + ROWS], values, where) if name + ROWS in found else None
        _fill(values, name, found[name], rows, where)
    trained.hull.support.copy_(_inflated(found["hull"], trained.hull.support.shape, where))


def parameters_of(trained: TrainedField) -> dict[str, Tensor]:
    """Return the parameters of field and classifier by their full names."""
    parts: dict[str, nn.Module] = {"field": trained.field}
    if trained.classifier is not None:
        parts["classifier"] = trained.classifier
    return {
        f"{part}.{name}": values.detach()
        for part, module in parts.items()
        for name, values in module.named_parameters()
    }


def rows_near(field: TriplaneField, hull: Hull) -> Bool[Tensor, " rows"]:
    """Return the rows of the planes' table that a point near the hull can read."""
    near = hull.near.float()
    low = field.low.double().numpy()
    used = []
    for a, b in PLANES:
        third = next(axis for axis in range(3) if axis not in (a, b))
        mask = near.amax(dim=third)
        reach = [_reach(field, hull, low, axis) for axis in (a, b)]
        used.append((reach[0].float() @ mask @ reach[1].float().T > 0).reshape(-1))
    return torch.cat(used)


def _reach(
    field: TriplaneField, hull: Hull, low: np.ndarray, axis: int
) -> Bool[Tensor, "lines voxels"]:
    """Return which lines of cell corners a point in each layer of voxels can read, on one axis."""
    edges = hull.low[axis] + hull.voxel * np.arange(hull.support.shape[axis] + 1)
    at = (edges - low[axis]) / field.cell
    most = field.shape[axis] - 1
    first = np.floor(at[:-1] - SLACK).clip(0, most - 1)
    last = np.floor(at[1:] + SLACK).clip(0, most - 1) + 1
    lines = np.arange(most + 1)[:, None]
    return torch.from_numpy((lines >= first) & (lines <= last))


def _rows(bits: Tensor, values: Tensor, where: str) -> Bool[Tensor, " rows"]:
    count = len(values)
    if bits.dtype != torch.uint8 or bits.shape != (-(-count // 8),):
        raise BundleError(f"{where}: names rows of another table; train again")
    return torch.from_numpy(np.unpackbits(bits.numpy(), count=count).astype(bool))


def _fill(
    values: Tensor, name: str, found: Tensor, rows: Bool[Tensor, " rows"] | None, where: str
) -> None:
    shape = values.shape if rows is None else (int(rows.sum()), *values.shape[1:])
    dtype = torch.float16 if values.numel() >= HALF_FROM else torch.float32
    if found.shape != shape or found.dtype != dtype:
        raise BundleError(
            f"{where}: {name} is {tuple(found.shape)} {found.dtype}, config.json asks for "
            f"{tuple(shape)} {dtype}; train again"
        )
    if not bool(torch.isfinite(found).all()):
        raise BundleError(f"{where}: {name} holds values that are not finite; train again")
    if rows is None:
        values.copy_(found)
    else:
        values.zero_()
        values[rows] = found.to(values.dtype)


def _inflated(found: UInt8[Tensor, " bytes"], shape: torch.Size, where: str) -> Tensor:
    size = int(np.prod(shape))
    grid = " x ".join(map(str, shape))
    message = f"{where}: hull is damaged, it does not inflate to {grid} bytes; train again"
    if found.dtype != torch.uint8 or found.ndim != 1:
        raise BundleError(message)
    inflate = zlib.decompressobj()
    try:  # never more than what is asked for, whatever the file claims
        data = inflate.decompress(found.numpy().tobytes(), size + 1)
    except zlib.error as error:
        raise BundleError(message) from error
    if len(data) != size or not inflate.eof:
        raise BundleError(message)
    return torch.frombuffer(bytearray(data), dtype=torch.uint8).reshape(shape).float() / 255
