"""Define the exact camera's record, which stands under a frame's `toonset` key."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from toonset.camera import Camera
from toonset.dataset.images.picture import MAX_PIXELS
from toonset.errors import BundleError
from toonset.json_file import LARGEST

Row = Annotated[list[float], Field(min_length=3, max_length=3)]
Rotation = Annotated[list[Row], Field(min_length=3, max_length=3)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class NativeCamera(BaseModel):
    """The exact camera of `toonset.camera.Camera`, OpenCV axes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    model: Literal["orthographic", "pinhole"]
    rotation: Rotation
    target: Row
    scale: float
    center: Pair
    k: float
    pixel_aspect: float = 1.0
    size_wh: tuple[int, int]
    pinhole_error_px: float = Field(default=0.0, ge=0)

    @classmethod
    def of(cls, camera: Camera, pinhole_error_px: float = 0.0) -> NativeCamera:
        """Return the record of a camera."""
        return cls(
            model="orthographic" if camera.is_orthographic else "pinhole",
            rotation=camera.rotation.tolist(),
            target=camera.target.tolist(),
            scale=camera.scale,
            center=camera.center.tolist(),
            k=camera.k,
            pixel_aspect=camera.pixel_aspect,
            size_wh=camera.size_wh,
            pinhole_error_px=pinhole_error_px,
        )

    def camera(self) -> Camera:
        """Return the camera of the record.

        Raises:
            CameraError: the record is not a camera.
            BundleError: its numbers are beyond what is computed with, or `model` contradicts k.
        """
        numbers = [*np.ravel(self.rotation), *self.target, *self.center]
        check_numbers([*numbers, self.scale, self.k, self.pixel_aspect])
        rotation, target = np.array(self.rotation), np.array(self.target)
        camera = Camera(
            rotation,
            target,
            self.scale,
            np.array(self.center),
            self.size_wh,
            self.k,
            self.pixel_aspect,
        )
        if camera.is_orthographic != (self.model == "orthographic"):
            raise BundleError(f"camera: is called {self.model} but k is {self.k:g}")
        check_range(camera)
        return camera


def check_numbers(numbers: list[float]) -> None:
    """Refuse numbers that could overflow before a camera is made of them.

    Raises:
        BundleError: one of them is beyond 1e9.
    """
    largest = max(abs(number) for number in numbers)
    if largest > LARGEST:
        raise BundleError(f"camera: {largest:.3g}, at most {LARGEST:g} is computed with")


def check_range(camera: Camera) -> None:
    """Refuse a camera that cannot be computed with.

    Raises:
        BundleError: a number beyond 1e9 (or a scale or k below 1e-9), or more pixels than are
            drawn.
    """
    scales = [camera.scale, camera.pixel_aspect, *([camera.k] if camera.k else [])]
    check_numbers([*camera.target, *camera.center, *scales, *(1 / scale for scale in scales)])
    width, height = camera.size_wh
    if width * height > MAX_PIXELS:
        raise BundleError(
            f"size {width:.3g} x {height:.3g} px, at most {MAX_PIXELS / 1e6:g} megapixels are drawn"
        )
