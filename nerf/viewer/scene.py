"""Pack a run for the page: numbers as JSON, and all arrays in one deflated blob.

The field itself goes along, planes and decoder: it is the smallest form that it has, and a page
reads it once, at the hull's voxels, as `toonset.nerf.render.baked` does.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8

from toonset.camera import Camera
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.nerf.fields.base import DENSITY_SHIFT
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.look.blend import (
    BORDER,
    FEATHER,
    FIELD_VOTE,
    HOLE_PX,
    LEAD,
    OWN,
    OWN_VOTE,
    SHARP,
    SIDE,
    SIDE_VOTE,
    SLIVER,
)
from toonset.nerf.look.drawings import STEP, Drawings, Texture, levels_of
from toonset.nerf.look.outline import CRUMB_AT, CRUMB_PX
from toonset.nerf.look.paint_flow import NEIGHBOURS
from toonset.nerf.look.shade import SOFT
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.views import baked_of
from toonset.nerf.run.tensors import rows_near
from toonset.nerf.viewer.volume import BLOCK, packed_hull
from toonset.view import premultiply

CHANNELS = 4  # of a texel
EDGE_STEPS = 5.0  # per pixel: how finely distances to an edge are kept
EFFORT = 9
MOST_PAINTS = 32  # that the page can tell apart: its shaders' arrays, page/field_layers.js


@dataclass(eq=False)
class Blob:
    """Arrays one after the other, each from a multiple of four bytes on."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0

    def add(self, values: np.ndarray) -> dict[str, Any]:
        """Append an array; return where it lies."""
        data = np.ascontiguousarray(values).tobytes()
        record = {"at": self.size, "type": values.dtype.name, "shape": list(values.shape)}
        self.parts += [data, b"\0" * (-len(data) % 4)]
        self.size += len(data) + len(self.parts[-1])
        return record

    def deflated(self) -> bytes:
        """Return everything, as `DecompressionStream("deflate")` reads it."""
        return zlib.compress(b"".join(self.parts), EFFORT)


def camera_record(camera: Camera) -> dict[str, Any]:
    """Return a camera's numbers: see `toonset.camera`."""
    return {
        "rotation": camera.rotation.reshape(-1).tolist(),
        "target": camera.target.tolist(),
        "scale": camera.scale,
        "center": camera.center.tolist(),
        "size": list(camera.size_wh),
        "k": camera.k,
        "aspect": camera.pixel_aspect,
    }


def field_record(trained: TrainedField, blob: Blob) -> dict[str, Any]:
    """Return a trained field.

    Raises:
        BundleError: it has more colours than a page can show.
    """
    triplane = trained.field
    assert isinstance(triplane, TriplaneField)
    drawn = () if trained.drawings is None else trained.drawings.paints
    count = max(len(drawn), 0 if trained.palette is None else len(trained.palette))
    if count > MOST_PAINTS:
        raise BundleError(
            f"run: has {count} colours, a page shows {MOST_PAINTS} at most; take fewer with "
            "`toonset palette --max-colors` or --colors, and train again"
        )
    baked: Baked = baked_of(trained)
    hull = packed_hull(trained)
    texels, low, step = _planes(triplane, rows_near(triplane, trained.hull).numpy())
    return {
        "low": triplane.low.tolist(),
        "cell": triplane.cell,
        "shape": list(triplane.shape),
        "planes": {"texels": blob.add(texels), "axes": PLANES, "low": low, "step": step},
        "hidden": _weights(triplane.hidden),
        "out": _weights(triplane.out),
        "densityShift": DENSITY_SHIFT,
        "stepsPerCell": trained.step / triplane.cell,
        "hull": {
            "low": hull.low.tolist(),
            "voxel": trained.hull.voxel,
            "box": hull.box.tolist(),
            "support": blob.add(hull.support),
            "safe_steps": blob.add(hull.safe_steps),
            "block": BLOCK,
        },
        "step": trained.step,
        "table": None if baked.labels is None else blob.add(baked.labels.numpy()),
        "paints": baked.paints.nan_to_num(-1.0).tolist(),
    }


def _planes(
    triplane: TriplaneField, used: np.ndarray
) -> tuple[UInt8[np.ndarray, "layers height width 4"], list[list[float]], list[list[float]]]:
    """Return the planes as layers of a texture, four channels each, padded to one size."""
    images = [image.detach().numpy() for image in triplane.plane_images()]
    height, width = (max(image.shape[axis] for image in images) for axis in (0, 1))
    masks = np.split(used, np.cumsum([image.shape[0] * image.shape[1] for image in images])[:-1])
    layers, lows, steps = [], [], []
    for image, mask in zip(images, masks, strict=True):
        tiles, low, step = _packed(image, mask.reshape(image.shape[:2]))
        room = [(0, 0), (0, height - image.shape[0]), (0, width - image.shape[1]), (0, 0)]
        layers.append(np.pad(tiles, room, mode="edge"))
        lows.append(low)
        steps.append(step)
    return np.concatenate(layers), lows, steps


def _packed(
    values: Float[np.ndarray, "height width channels"], used: Bool[np.ndarray, "height width"]
) -> tuple[UInt8[np.ndarray, "layers height width 4"], list[float], list[float]]:
    """Return a plane's features as bytes, and low and step of every channel.

    feature = low + step * byte. Texels that are never read (not `used`) are low everywhere.
    """
    height, width, channels = values.shape
    chosen = values[used] if used.any() else values.reshape(-1, channels)
    low = chosen.min(axis=0)
    step = np.maximum(chosen.max(axis=0) - low, 1e-12) / 255
    codes = np.where(used[..., None], ((values - low) / step + 0.5).clip(0, 255), 0)
    padded = np.pad(codes.astype(np.uint8), ((0, 0), (0, 0), (0, -channels % CHANNELS)))
    tiles = padded.reshape(height, width, -1, CHANNELS).transpose(2, 0, 1, 3)
    return tiles, low.tolist(), step.tolist()


def _weights(layer: torch.nn.Linear) -> dict[str, Any]:
    """Return a layer's weights and biases, six digits each."""
    digits = np.vectorize(lambda value: float(f"{value:.6g}"))
    weight, bias = layer.weight.detach().double().numpy(), layer.bias.detach().double().numpy()
    return {"weight": digits(weight).tolist(), "bias": digits(bias).tolist()}


def drawings_record(drawings: Drawings, blob: Blob) -> dict[str, Any]:
    """Return the page's record of the drawn look."""
    textures = drawings.textures
    paint, whole, about = _atlases(drawings, textures)
    shape = drawings.shape
    pen, outline = (line and asdict(line) for line in (drawings.pen, drawings.outline))
    return {
        "cameras": [camera_record(texture.camera) for texture in textures],
        "paint": blob.add(paint),
        "whole": blob.add(whole),
        "about": blob.add(about),
        "edgeSteps": EDGE_STEPS,
        "depths": list(drawings.depths),
        "height": drawings.height,
        "paints": drawings.paints.tolist(),
        "pen": pen,
        "outline": outline,
        "bent": drawings.bent,
        "flows": [
            {
                "pair": list(flow.pair),
                "camera": camera_record(flow.camera),
                "flow": blob.add(flow.flow.astype(np.float16)),
            }
            for flow in drawings.flows
        ],
        "shape": shape and _surface(shape.vertices, shape.faces, shape.beyond, blob),
        "steps": drawings.steps and asdict(drawings.steps),
        "shade": drawings.shade and asdict(drawings.shade),
        "shadow": drawings.painted_shadow and list(drawings.painted_shadow.factor),
        "slack": STEP,
        "crumb": {"area": CRUMB_PX, "hole": HOLE_PX, "height": CRUMB_AT},
        "border": BORDER,
        "sliver": SLIVER,
        "fieldVote": FIELD_VOTE,
        "sideVote": SIDE_VOTE,
        "ownVote": OWN_VOTE,
        "lead": LEAD if drawings.apart else 0.0,
        "sharp": SHARP if drawings.apart else 1,
        "featherPx": FEATHER * drawings.height * max(view.camera.scale for view in drawings.views),
        "softNormals": SOFT,
        "own": OWN,
        "side": SIDE,
        "neighbours": NEIGHBOURS,
    }


def plain_drawings_record(
    cameras: Sequence[Camera],
    pictures: Sequence[UInt8[np.ndarray, "_ _ 4"]],
    mesh: Mesh,
    blob: Blob,
) -> dict[str, Any]:
    """Return drawings and a body beside them, before anything is trained."""
    sizes = [picture.shape[:2] for picture in pictures]
    whole = [_bytes(premultiply(picture) / 255) for picture in pictures]
    return {
        "cameras": [camera_record(camera) for camera in cameras],
        "whole": blob.add(np.stack([_padded(one, _largest(sizes), "constant") for one in whole])),
        "shape": _surface(mesh.vertices, mesh.faces, 0.0, blob),
        "steps": None,
        "shade": None,
    }


def _surface(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"], beyond: float, blob: Blob
) -> dict[str, Any]:
    return {
        "vertices": blob.add(vertices.astype(np.float32)),
        "faces": blob.add(faces.astype(np.uint32)),
        "beyond": beyond,
    }


def _largest(sizes: Sequence[tuple[int, ...]]) -> tuple[int, int]:
    return max(size[0] for size in sizes), max(size[1] for size in sizes)


def _padded(
    layer: UInt8[np.ndarray, "h w 4"], size: tuple[int, int], mode: Any
) -> UInt8[np.ndarray, "height width 4"]:
    room = [(0, size[0] - layer.shape[0]), (0, size[1] - layer.shape[1]), (0, 0)]
    return np.pad(layer, room, mode=mode)


def _atlases(
    drawings: Drawings, textures: tuple[Texture, ...]
) -> tuple[
    UInt8[np.ndarray, "n h w 4"], UInt8[np.ndarray, "n h w 4"], UInt8[np.ndarray, "n h w 4"]
]:
    """Return, a layer per drawing: paint and label; the drawing itself; depth and edges.

    Depth is that of `Texture.far`, in levels of `Drawing`; then pixels to the nearest edge, times
    EDGE_STEPS; then coverage.
    """
    size = _largest([texture.labels.shape for texture in textures])
    paint, whole, about = [], [], []
    for texture in textures:
        paint.append(_padded(np.dstack([_bytes(texture.paint), texture.labels]), size, "edge"))
        whole.append(_padded(_bytes(texture.whole), size, "constant"))
        far = np.where(np.isfinite(texture.far), texture.far, np.nan)
        edge = np.rint(texture.to_edge * EDGE_STEPS).clip(0, 255).astype(np.uint8)
        layers = [levels_of(far, drawings.depths), edge, _bytes(texture.whole[..., 3])]
        about.append(_padded(np.dstack([*layers, np.zeros_like(edge)]), size, "constant"))
    return np.stack(paint), np.stack(whole), np.stack(about)


def _bytes(values: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape"]:
    return (values * 255 + 0.5).clip(0, 255).astype(np.uint8)
