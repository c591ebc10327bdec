"""Write and read the drawn look's files.

    drawings.png            the drawings as they were trained on, side by side, tops aligned
    originals.png           those of them that were bent or moved, as they are on the sheet
    paint.png               the same without outlines and what else new views have drawn anew
    drawings.safetensors    flow.0   (h, w, 2) how far paint lies apart, of the first pair, and on
                            depth    (height, all widths) levels of the field's surface in each; or
                            places   (v, 3) the mannequin's vertices, in steps of a grid, and
                            faces    (f, 3) its triangles, where it is the surface;
                            limbs.0.places, limbs.0.faces: the same of limbs that the first drawing
                            alone has, and on

Their cameras, the pairs, outline, lines and shadow are in config.json under `field.drawings`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from jaxtyping import Shaped, UInt8
from pydantic import BaseModel, ConfigDict, Field, field_validator
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.images.picture import MAX_PIXELS, encode_png, load_rgba
from toonset.errors import BundleError, CameraError
from toonset.json_file import Byte, Number, Share, Size
from toonset.nerf.hull.mannequin_shape import MOST_FACES, MOST_STEPS, Shape
from toonset.nerf.look.drawing import Drawing, Original
from toonset.nerf.look.drawings import Drawings, PairFlow
from toonset.nerf.look.outline import LONGEST_PX, Outline
from toonset.nerf.look.shade import Shade
from toonset.nerf.look.step_lines import StepLines
from toonset.palette.palette import Shadow
from toonset.palette.pixels.ramp_labels import Ramp
from toonset.write import write_bytes

PICTURES, PAINT, SURFACES = "drawings.png", "paint.png", "drawings.safetensors"
ORIGINALS = "originals.png"
MAX_BYTES = 512 * 2**20
MOST_VIEWS = 4096
Color = tuple[Byte, Byte, Byte]
Light = Annotated[float, Field(ge=-0.1, le=1.2)]  # of OKLab; dark ends may lie a little below 0
Hue = Annotated[float, Field(ge=-1, le=1)]  # a or b of OKLab
Count = Annotated[int, Field(ge=0, lt=MOST_VIEWS)]


class PairRecord(BaseModel):
    """Two neighbouring drawings; fields as in `PairFlow`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    pair: tuple[Count, Count]
    camera: NativeCamera


class OriginalRecord(BaseModel):
    """A drawing as it is on the sheet: its number among the drawings, and its camera."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    number: Count
    camera: NativeCamera


class ShadowRecord(BaseModel):
    """The shadow of the drawings' palette; fields as in `Shadow`, which palette.json rounds."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    factor: tuple[Share, Share, Share]
    spread: tuple[Number, Number, Number]
    bits: Number


class RampRecord(BaseModel):
    """Colours of a paint from dark to light; fields as in `Ramp`."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    stops: list[tuple[Light, Hue, Hue]] = Field(min_length=1, max_length=255)
    light: Light
    spread: Share

    @field_validator("stops")
    @classmethod
    def _ascends(cls, stops: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
        if any(one[0] > other[0] for one, other in pairwise(stops)):
            raise ValueError("must go from dark to light")
        return stops


class ShapeRecord(BaseModel):
    """Grid of a `Shape`: its origin and step."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    low: tuple[Number, Number, Number]
    step: Size
    beyond: float = Field(ge=0, le=1e9)


class LimbsRecord(BaseModel):
    """Limbs that one drawing alone has: its number among the drawings, and their grid."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    number: Count
    shape: ShapeRecord

    @property
    def prefix(self) -> str:
        """Return how the names of its tensors begin."""
        return _prefix(self.number)


class DrawingsRecord(BaseModel):
    """Record of `Drawings` in config.json."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, revalidate_instances="always")
    cameras: list[NativeCamera] = Field(min_length=1, max_length=MOST_VIEWS)
    pairs: list[PairRecord] = Field(max_length=MOST_VIEWS)
    outline: Outline | None
    palette: list[Color] = Field(min_length=1, max_length=254)
    height: Size
    depths: tuple[Number, Number]
    bent: bool
    shape: ShapeRecord | None
    steps: StepLines | None
    shade: Shade | None
    shadow: ShadowRecord | None = None
    ramps: list[RampRecord] = Field(default=[], max_length=254)
    limbs: list[LimbsRecord] = Field(default=[], max_length=MOST_VIEWS)
    mirrored: list[Count] = Field(default=[], max_length=MOST_VIEWS)
    originals: list[OriginalRecord] = Field(default=[], max_length=MOST_VIEWS)

    @classmethod
    def of(cls, drawings: Drawings) -> DrawingsRecord:
        """Return the record of drawings."""
        shape = drawings.shape
        pairs = [{"pair": f.pair, "camera": NativeCamera.of(f.camera)} for f in drawings.flows]
        return cls.model_validate(
            {
                "cameras": [NativeCamera.of(view.camera) for view in drawings.views],
                "pairs": pairs,
                "outline": drawings.outline,
                "palette": drawings.palette.tolist(),
                "height": drawings.height,
                "depths": drawings.depths,
                "bent": drawings.bent,
                "shape": shape and _where(shape),
                "steps": drawings.steps,
                "shade": drawings.shade,
                "shadow": drawings.shadow and asdict(drawings.shadow),
                "ramps": [
                    {"stops": one.stops.tolist(), "light": one.light, "spread": one.spread}
                    for one in drawings.ramps
                ],
                "limbs": [
                    {"number": i, "shape": _where(view.limbs)}
                    for i, view in enumerate(drawings.views)
                    if view.limbs
                ],
                "mirrored": [i for i, view in enumerate(drawings.views) if view.mirrored],
                "originals": [
                    {"number": i, "camera": NativeCamera.of(view.original.camera)}
                    for i, view in enumerate(drawings.views)
                    if view.original
                ],
            }
        )


def _where(shape: Shape) -> dict[str, Any]:
    return {"low": shape.low.tolist(), "step": shape.step, "beyond": shape.beyond}


def write_drawings(folder: Path, drawings: Drawings) -> None:
    """Write drawings.png, paint.png and drawings.safetensors."""
    views = drawings.views
    write_bytes(folder / PICTURES, encode_png(_side_by_side([view.rgba for view in views])))
    write_bytes(folder / PAINT, encode_png(_side_by_side([view.paint for view in views])))
    originals = [view.original.rgba for view in views if view.original]
    if originals:
        write_bytes(folder / ORIGINALS, encode_png(_side_by_side(originals)))
    tensors = {f"flow.{i}": flow.flow for i, flow in enumerate(drawings.flows)}
    if drawings.shape is None:
        levels = [view.levels for view in views if view.levels is not None]
        tensors["depth"] = _side_by_side(levels)
    else:
        tensors |= _triangles(drawings.shape)
    for i, view in enumerate(views):
        if view.limbs:
            tensors |= _triangles(view.limbs, _prefix(i))
    write_bytes(folder / SURFACES, save({k: torch.from_numpy(v) for k, v in tensors.items()}))


def _prefix(number: int) -> str:
    return f"limbs.{number}."


def _triangles(shape: Shape, prefix: str = "") -> dict[str, np.ndarray]:
    faces = shape.faces.astype(np.uint16)
    return {f"{prefix}places": shape.places, f"{prefix}faces": faces}


def read_drawings(folder: Path, record: DrawingsRecord) -> Drawings:
    """Return the drawings of a run folder.

    Raises:
        BundleError: a file is missing or damaged, or does not belong to the record, or the record
            holds a camera that cannot be.
        PictureError: a picture is invalid.
    """
    if record.ramps and len(record.ramps) != len(record.palette):
        where = f"{folder / 'config.json'}: field.drawings.ramps"
        raise BundleError(f"{where}: must have one ramp per palette colour; train again")
    try:
        cameras = [camera.camera() for camera in record.cameras]
        places = [pair.camera.camera() for pair in record.pairs]
        drawn_by = [original.camera.camera() for original in record.originals]
    except (BundleError, CameraError) as error:
        where = f"{folder / 'config.json'}: field.drawings"
        raise BundleError(f"{where}: {error}; train again") from error
    rgba, paint = (_apart(_picture(folder / name, cameras), cameras) for name in (PICTURES, PAINT))
    originals = _originals(folder, record, drawn_by)
    file = folder / SURFACES
    found = load_tensors(file)
    _check_tensors(found, record, cameras, places, file)
    flows = []
    for i, (pair, camera) in enumerate(zip(record.pairs, places, strict=True)):
        flow = found[f"flow.{i}"]
        if not bool((flow.float().abs() <= LONGEST_PX).all()):
            raise BundleError(f"{file}: flow.{i} holds displacements out of range; train again")
        if max(pair.pair) >= len(cameras) or pair.pair[0] == pair.pair[1]:
            what = f"pair {pair.pair} is none of {len(cameras)} drawings"
            raise BundleError(f"{file}: {what}; train again")
        flows.append(PairFlow(pair.pair, camera, flow.numpy()))
    shape = None if record.shape is None else _shape(record.shape, found, file)
    levels: list[np.ndarray | None] = [None] * len(cameras)
    if shape is None:
        levels = [*_apart(found["depth"].numpy(), cameras)]
    parts = zip(cameras, rgba, paint, levels, strict=True)
    limbs = {own.number: _shape(own.shape, found, file, own.prefix) for own in record.limbs}
    views = tuple(
        Drawing(
            camera, own, flat[..., :3], level, i in record.mirrored, originals.get(i), limbs.get(i)
        )
        for i, (camera, own, flat, level) in enumerate(parts)
    )
    return Drawings(
        views,
        tuple(flows),
        record.outline,
        record.outline,
        np.array(record.palette, dtype=np.uint8),
        record.height,
        record.depths,
        record.bent,
        shape,
        record.steps,
        record.shade,
        None if record.shadow is None else Shadow(**record.shadow.model_dump()),
        tuple(Ramp(np.array(one.stops), one.light, one.spread) for one in record.ramps),
    )


def _originals(
    folder: Path, record: DrawingsRecord, cameras: Sequence[Camera]
) -> dict[int, Original]:
    """Return the drawings that are kept as they are on the sheet, by number."""
    if not cameras:
        return {}
    pictures = _apart(_picture(folder / ORIGINALS, cameras), cameras)
    parts = zip(record.originals, cameras, pictures, strict=True)
    return {own.number: Original(camera, rgba) for own, camera, rgba in parts}


def _whole(cameras: Sequence[Camera]) -> tuple[int, int]:
    """Return height and width of the drawings' pictures side by side."""
    sizes = [camera.size_wh for camera in cameras]
    return max(high for _, high in sizes), sum(wide for wide, _ in sizes)


def _picture(file: Path, cameras: Sequence[Camera]) -> UInt8[np.ndarray, "height width 4"]:
    rgba = load_rgba(file, MAX_PIXELS)
    high, wide = _whole(cameras)
    if rgba.shape[:2] != (high, wide):
        raise BundleError(
            f"{file}: is {rgba.shape[1]} x {rgba.shape[0]} px, config.json asks for "
            f"{wide} x {high}; train again"
        )
    return rgba


def _check_tensors(
    found: Mapping[str, Tensor],
    record: DrawingsRecord,
    cameras: Sequence[Camera],
    places: Sequence[Camera],
    file: Path,
) -> None:
    """Refuse tensors that are missing, unknown, or of another shape or type."""
    wanted: dict[str, tuple[tuple[int, ...], torch.dtype]] = {
        f"flow.{i}": ((camera.size_wh[1], camera.size_wh[0], 2), torch.float16)
        for i, camera in enumerate(places)
    }
    there = {name: (tuple(values.shape), values.dtype) for name, values in found.items()}
    if record.shape is None:
        wanted["depth"] = (_whole(cameras), torch.uint8)
    shapes = [own.prefix for own in record.limbs]
    for prefix in shapes if record.shape is None else ["", *shapes]:
        for kind, most in (("places", MOST_STEPS), ("faces", MOST_FACES)):
            name = prefix + kind
            rows = found[name].shape[0] if name in found and found[name].dim() else 0
            wanted[name] = ((min(max(1, rows), most), 3), torch.uint16)
    if there != wanted:
        odd = ", ".join(
            sorted(name for name in there | wanted if there.get(name) != wanted.get(name))
        )
        raise BundleError(
            f"{file}: tensors missing, unknown or of another shape: {odd}; train again"
        )


def _shape(record: ShapeRecord, found: Mapping[str, Tensor], file: Path, prefix: str = "") -> Shape:
    places = found[f"{prefix}places"].numpy()
    faces = found[f"{prefix}faces"].numpy().astype(np.int64)
    if faces.max() >= len(places):
        raise BundleError(f"{file}: faces name vertices that are not there; train again")
    return Shape(np.array(record.low), record.step, places, faces, record.beyond)


def _apart(picture: np.ndarray, cameras: Sequence[Camera]) -> list[np.ndarray]:
    """Return the pictures that lie side by side."""
    found, left = [], 0
    for camera in cameras:
        wide, high = camera.size_wh
        found.append(picture[:high, left : left + wide])
        left += wide
    return found


def load_tensors(file: Path) -> dict[str, Tensor]:
    """Return the tensors of a safetensors file.

    Raises:
        BundleError: it is too large, cannot be read, or is damaged.
    """
    try:
        if not file.is_file():  # a device could be read for ever
            raise BundleError(f"{file}: is not there, or no regular file; train again")
        if file.stat().st_size > MAX_BYTES:
            raise BundleError(f"{file}: larger than {MAX_BYTES >> 20} MiB; train again")
        return load(file.read_bytes())
    except OSError as error:
        reason = f"cannot be read ({error.strerror}); check its permissions"
        raise BundleError(f"{file}: {reason}") from error
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
