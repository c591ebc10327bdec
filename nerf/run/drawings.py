"""What the drawn look is made of, on disk.

    drawings.png            the drawings as they were trained on, side by side, tops aligned
    drawings.safetensors    depth    (height, all widths) levels of the field's surface in each
                            flow.0   (h, w, 2) how far paint lies apart, of the first pair, and on

Their cameras, the pairs and the outline are in config.json under `field.drawings`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from jaxtyping import Shaped
from pydantic import BaseModel, ConfigDict, Field
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.images.picture import MAX_PIXELS, encode_png, load_rgba
from toonset.errors import BundleError
from toonset.nerf.look.drawings import Drawing, Drawings, PairFlow
from toonset.nerf.look.outline import Outline
from toonset.nerf.run.records import MOST_VIEWS, Byte, Number, Width
from toonset.write import write_bytes

PICTURES, SURFACES = "drawings.png", "drawings.safetensors"
MAX_BYTES = 512 * 2**20
LONGEST_PX = 4096.0  # a displacement
Color = tuple[Byte, Byte, Byte]
Count = Annotated[int, Field(ge=0, lt=MOST_VIEWS)]


class OutlineRecord(BaseModel):
    """The line round the figures; fields as in `Outline`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    rgb: Color
    width_px: Width


class PairRecord(BaseModel):
    """Two neighbouring drawings; fields as in `PairFlow`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    pair: tuple[Count, Count]
    camera: NativeCamera


class DrawingsRecord(BaseModel):
    """What config.json holds of `Drawings`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    cameras: list[NativeCamera] = Field(min_length=1, max_length=MOST_VIEWS)
    pairs: list[PairRecord] = Field(max_length=MOST_VIEWS)
    outline: OutlineRecord | None
    palette: list[Color] = Field(min_length=1, max_length=254)
    height: float = Field(gt=0, le=1e9)
    depths: tuple[Number, Number]
    bent: bool

    @classmethod
    def of(cls, drawings: Drawings) -> DrawingsRecord:
        """Return the record of drawings."""
        line = drawings.outline
        pairs = [{"pair": f.pair, "camera": NativeCamera.of(f.camera)} for f in drawings.flows]
        return cls.model_validate(
            {
                "cameras": [NativeCamera.of(view.camera) for view in drawings.views],
                "pairs": pairs,
                "outline": line and {"rgb": line.rgb, "width_px": line.width_px},
                "palette": drawings.palette.tolist(),
                "height": drawings.height,
                "depths": drawings.depths,
                "bent": drawings.bent,
            }
        )


def write_drawings(folder: Path, drawings: Drawings) -> None:
    """Write drawings.png and drawings.safetensors."""
    write_bytes(folder / PICTURES, encode_png(_side_by_side([v.rgba for v in drawings.views])))
    depth = torch.from_numpy(_side_by_side([view.levels for view in drawings.views]))
    flows = {f"flow.{i}": torch.from_numpy(f.flow) for i, f in enumerate(drawings.flows)}
    write_bytes(folder / SURFACES, save({"depth": depth, **flows}))


def read_drawings(folder: Path, record: DrawingsRecord) -> Drawings:
    """Return the drawings of a run folder.

    Raises:
        BundleError: a file is missing or damaged, or does not belong to the record.
        CameraError: a camera's record is none.
        PictureError: drawings.png is no picture.
    """
    cameras = [camera.camera() for camera in record.cameras]
    sizes = [camera.size_wh for camera in cameras]
    whole = (max(high for _, high in sizes), sum(wide for wide, _ in sizes))
    where = folder / PICTURES
    rgba = load_rgba(where, MAX_PIXELS)
    if rgba.shape[:2] != whole:
        raise BundleError(
            f"{where}: is {rgba.shape[1]} x {rgba.shape[0]} px, config.json asks for "
            f"{whole[1]} x {whole[0]}; train again"
        )
    file = folder / SURFACES
    found = load_tensors(file)
    wanted: dict[str, tuple[tuple[int, ...], torch.dtype]] = {"depth": (whole, torch.uint8)}
    places = [pair.camera.camera() for pair in record.pairs]
    for i, camera in enumerate(places):
        wide, high = camera.size_wh
        wanted[f"flow.{i}"] = ((high, wide, 2), torch.float16)
    there = {name: (tuple(values.shape), values.dtype) for name, values in found.items()}
    if there != wanted:
        odd = ", ".join(
            sorted(name for name in there | wanted if there.get(name) != wanted.get(name))
        )
        raise BundleError(
            f"{file}: tensors missing, unknown or of another shape: {odd}; train again"
        )
    flows = []
    for i, (pair, camera) in enumerate(zip(record.pairs, places, strict=True)):
        flow = found[f"flow.{i}"]
        if not bool((flow.float().abs() <= LONGEST_PX).all()):
            raise BundleError(f"{file}: flow.{i} holds displacements out of range; train again")
        if max(pair.pair) >= len(cameras) or pair.pair[0] == pair.pair[1]:
            raise BundleError(f"{file}: pair {pair.pair} is none of {len(cameras)} drawings")
        flows.append(PairFlow(pair.pair, camera, flow.numpy()))
    depth, left, views = found["depth"].numpy(), 0, []
    for camera, (wide, high) in zip(cameras, sizes, strict=True):
        at = (slice(0, high), slice(left, left + wide))
        views.append(Drawing(camera, rgba[at], depth[at]))
        left += wide
    line = None if record.outline is None else Outline(**record.outline.model_dump())
    return Drawings(
        tuple(views),
        tuple(flows),
        line,
        line,
        np.array(record.palette, dtype=np.uint8),
        record.height,
        record.depths,
        record.bent,
    )


def load_tensors(file: Path) -> dict[str, Tensor]:
    """Return the tensors of a safetensors file.

    Raises:
        BundleError: it is too large, cannot be read, or is damaged.
    """
    try:
        if file.stat().st_size > MAX_BYTES:
            raise BundleError(f"{file}: larger than {MAX_BYTES >> 20} MiB; not a toonset run")
        return load(file.read_bytes())
    except OSError as error:
        raise BundleError(f"{file}: cannot be read ({error.strerror})") from error
    except (SafetensorError, ValueError, KeyError) as error:
        raise BundleError(f"{file}: is damaged ({error}); train again") from error


def _side_by_side(
    pictures: list[Shaped[np.ndarray, "height width *channels"]],
) -> Shaped[np.ndarray, "most_height all_widths *channels"]:
    """Return pictures in a row, what is beyond them 0."""
    height = max(len(picture) for picture in pictures)
    rest = [(0, 0)] * (pictures[0].ndim - 1)
    padded = [np.pad(picture, [(0, height - len(picture)), *rest]) for picture in pictures]
    return np.ascontiguousarray(np.concatenate(padded, axis=1))
