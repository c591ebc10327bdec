"""Views of bundles and data sets as a PyTorch `Dataset`: pictures, labels and cameras as tensors.

Everything but the pictures is read, and checked, when the data set is opened; a picture is decoded
when its view is asked for, in whichever worker asks. Parquet hands out whole row groups: views in
their order are read once, shuffled ones need a group each, for which the other formats are made.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TypedDict

import numpy as np
import torch
from jaxtyping import Float, Int64, UInt8
from torch import Tensor
from torch.utils.data import Dataset

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import Bundle
from toonset.dataset.bundle.transforms_read import member
from toonset.dataset.packed_views import CARD, Split, views_of_pack
from toonset.dataset.stored_views import StoredView, views_of_bundle
from toonset.errors import UsageError
from toonset.palette.pixels.labels import UNLABELLED


class ViewItem(TypedDict):
    """One view; the module `toonset.camera` states all conventions.

    Attributes:
        name: sheet and picture, e.g. "knight/000.png"; of a bundle its folder is the sheet.
        image: sRGB in [0, 1], not multiplied by alpha.
        alpha: how far the figure covers a pixel, in [0, 1].
        labels: number of the palette colour, 255 = none (background, blends, no palette).
        K: intrinsics in pixels; the first pixel's centre is (0.5, 0.5).
        world_from_camera: pose, camera axes x right, y down, z forward. K and pose are those of a
            pinhole: the far one, 100 body heights away, where the view is orthographic.
        image_from_world: the exact projection of either kind: (u w, v w, w) of (x, y, z, 1); of an
            orthographic view its last row is 0 0 0 1.
        orthographic: whether it is.
        pinhole_error_px: by how much K and pose miss the exact projection, at most; 0 of pinholes.
        sigma: one standard deviation of yaw, elevation and roll, radians; NaN where a folder has
            no calibration.
        size_wh: width and height of the picture itself, without padding.
    """

    name: str
    image: Float[Tensor, "3 height width"]
    alpha: Float[Tensor, "1 height width"]
    labels: Int64[Tensor, "height width"]
    K: Float[Tensor, "3 3"]
    world_from_camera: Float[Tensor, "4 4"]
    image_from_world: Float[Tensor, "3 4"]
    orthographic: bool
    pinhole_error_px: float
    sigma: Float[Tensor, " 3"]
    size_wh: Int64[Tensor, " 2"]


class ViewDataset(Dataset[ViewItem]):
    """Views of a bundle, or of a data set that `toonset pack` wrote, one after the other.

    Pictures and alpha are float32, cameras float64, for a far pinhole's numbers are large. Views
    differ in size: without `padded`, load them one by one (`batch_size=None`) or as lists
    (`collate_fn=list`). Several bundles: `torch.utils.data.ConcatDataset`.

    Attributes:
        source: the folder.
        largest_wh: of any picture.
    """

    def __init__(
        self, source: str | Path | Bundle, *, split: Split | None = None, padded: bool = False
    ) -> None:
        """Read the values of all views.

        Args:
            source: a bundle, its folder, any folder with a transforms.json and RGBA pictures, or
                the folder of a data set (webdataset, parquet or folder).
            split: of a data set that has several: "train", "val" or "test".
            padded: give all pictures the size of the largest, with nothing at their right and
                lower edges; pixels and cameras stay as they are.

        Raises:
            BundleError: a file is missing, damaged, or leads out of the folder.
            UsageError: there is no such split, or several and none is named.
            SetupError: pyarrow is needed and missing.
        """
        self.source = source.folder if isinstance(source, Bundle) else Path(source)
        self._views = _views_of(self.source, split)
        sizes = [view.camera.size_wh for view in self._views]
        self.largest_wh = (max(w for w, _ in sizes), max(h for _, h in sizes))
        self._padded = padded

    def __len__(self) -> int:
        """Return the number of views."""
        return len(self._views)

    def __iter__(self) -> Iterator[ViewItem]:
        """Return the views in their order."""
        return (self[number] for number in range(len(self)))

    def __repr__(self) -> str:
        """Return where it is from and how many views it has."""
        return f"ViewDataset({str(self.source)!r}, {len(self)} views)"

    def __getitem__(self, index: int) -> ViewItem:
        """Return a view; negative numbers count from the end.

        Raises:
            IndexError: there is no such view.
            BundleError: a picture is gone, or of another size than its camera says.
            PictureError: it cannot be decoded.
        """
        view = self._views[index]
        rgba, labels = view.pixels()
        if self._padded:
            size_wh = self.largest_wh
            rgba, labels = _padded(rgba, size_wh, 0), _padded(labels, size_wh, UNLABELLED)
        planes = torch.from_numpy(np.ascontiguousarray(rgba.transpose(2, 0, 1))).float() / 255
        far = view.far_pinhole
        return {
            "name": view.name,
            "image": planes[:3],
            "alpha": planes[3:],
            "labels": torch.from_numpy(labels.astype(np.int64)),
            "K": torch.from_numpy(far.K),
            "world_from_camera": torch.from_numpy(far.world_from_camera),
            "image_from_world": torch.from_numpy(_projection(view.camera)),
            "orthographic": view.camera.is_orthographic,
            "pinhole_error_px": view.pinhole_error_px,
            "sigma": torch.tensor(view.sigma, dtype=torch.float64),
            "size_wh": torch.tensor(view.camera.size_wh),
        }

    def palette(self, index: int) -> UInt8[Tensor, "colors 3"]:
        """Return the sRGB colours that a view's labels number; empty without a palette."""
        return torch.tensor(self._views[index].palette, dtype=torch.uint8).reshape(-1, 3)


def _views_of(source: Path, split: Split | None) -> list[StoredView]:
    if source.is_dir() and member(source, CARD) is not None:
        return list(views_of_pack(source, split))
    if split is not None:
        raise UsageError(f"{source}: has no {CARD}, a bundle has no splits; leave split out")
    return views_of_bundle(source)


def _projection(camera: Camera) -> Float[np.ndarray, "3 4"]:
    """Return the matrix of the exact camera: see `toonset.camera`, both sides times 1 + k z."""
    local = np.column_stack([camera.rotation, -camera.rotation @ camera.target])
    w = camera.k * local[2] + [0, 0, 0, 1]
    u, v = camera.scale_uv[:, None] * local[:2] + camera.center[:, None] * w
    return np.stack([u, v, w])


def _padded(pixels: np.ndarray, size_wh: tuple[int, int], value: int) -> np.ndarray:
    """Return a picture with room at the right and below."""
    width, height = size_wh
    room = ((0, height - pixels.shape[0]), (0, width - pixels.shape[1]))
    return np.pad(pixels, (*room, *((0, 0),) * (pixels.ndim - 2)), constant_values=value)
