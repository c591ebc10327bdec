"""Read masks of other programs as alpha: white is the figure, however a program writes white.

Found in the wild: 0 and 255 (any depth, one bit too), 0 and 1 as arrays are saved, one label's
colour on black, the mask in the alpha channel over a plain colour, and inverted ones (COLMAP's and
others' "ignore here").
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8
from PIL import Image

from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.images.pixel_modes import GREY_16_MODES
from toonset.errors import BundleError, PictureError
from toonset.read import read_whole

HALF = 128
VARIES = 0.005  # of the pixels on either side: an alpha channel that says something
RIM, INSIDE = 0.9, 0.02  # white of the border, black of the picture: an inverted mask's least

VALUES, ALPHA, INVERTED = "values", "alpha", "inverted"
REMARKS = {
    VALUES: "hold 0 and one other value, which is taken for white",
    ALPHA: "have one colour and an alpha channel, which is taken for the mask",
    INVERTED: "are white around a black figure: read as inverted",
}


@dataclass(frozen=True, eq=False)
class Mask:
    """A mask as it was read.

    Attributes:
        alpha: 255 where the figure is.
        how: what was done to read it: keys of REMARKS.
    """

    alpha: UInt8[np.ndarray, "height width"]
    how: tuple[str, ...]


def read_mask(path: Path, picture_alpha: UInt8[np.ndarray, "height width"]) -> Mask:
    """Return a mask as alpha.

    Args:
        path: its file.
        picture_alpha: of the picture that it belongs to.

    Raises:
        PictureError: it cannot be read as a picture.
        BundleError: it has another size than its picture, or shows no figure.
    """
    data = read_whole(path, "mask", PictureError)
    rgba = decode_rgba(data, path)
    if rgba.shape[:2] != picture_alpha.shape:
        raise BundleError(
            f"{path}: is {rgba.shape[1]} x {rgba.shape[0]} px, its picture "
            f"{picture_alpha.shape[1]} x {picture_alpha.shape[0]}; give a mask of that size"
        )
    levels = _grey_16(data)
    how: tuple[str, ...] = ()
    if levels is None:
        levels = rgba[..., :3].max(axis=2)
        if _says_something(rgba[..., 3]):
            if _is_plain(levels[rgba[..., 3] >= HALF]):
                levels, how = rgba[..., 3], (ALPHA,)
            else:
                levels = np.minimum(levels, rgba[..., 3])
    alpha, stretched = _as_alpha(levels, path)
    how += (VALUES,) if stretched else ()
    if _is_inverted(alpha >= HALF, picture_alpha):
        return Mask(255 - alpha, (*how, INVERTED))
    return Mask(alpha, how)


def _grey_16(data: bytes) -> np.ndarray | None:
    """Return the values of a 16-bit grey picture, None of others: 1 of 65535 is 0 of 255."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with Image.open(io.BytesIO(data)) as image:
            return np.asarray(image).astype(np.uint16) if image.mode in GREY_16_MODES else None


def _as_alpha(levels: np.ndarray, path: Path) -> tuple[UInt8[np.ndarray, "height width"], bool]:
    """Return levels of any depth as alpha, and whether 0 and one value had to be told apart.

    Raises:
        BundleError: no pixel is half white.
    """
    top = int(levels.max())
    white = 65535 if levels.dtype == np.uint16 and top > 255 else 255
    if 0 < top < white and np.isin(levels, (0, top)).all():
        return np.where(levels == top, 255, 0).astype(np.uint8), True
    alpha = np.rint(levels * (255.0 / white)).astype(np.uint8)
    if alpha.max() < HALF:
        raise BundleError(
            f"{path}: its brightest value is {top} of {white}, so it shows no figure; make the "
            "figure white"
        )
    return alpha, False


def _says_something(alpha: UInt8[np.ndarray, "height width"]) -> bool:
    share = float((alpha < HALF).mean())
    return VARIES <= share <= 1 - VARIES


def _is_plain(levels: UInt8[np.ndarray, " pixels"]) -> bool:
    return float((np.abs(levels - np.median(levels)) > 16).mean()) < VARIES


def _is_inverted(
    figure: Bool[np.ndarray, "height width"], picture_alpha: UInt8[np.ndarray, "height width"]
) -> bool:
    """Return whether a mask is white where its figure is not.

    A picture with alpha says where its figure is; without, it does not lie all along the border.
    """
    if _says_something(picture_alpha):
        drawn = picture_alpha >= HALF
        return bool((figure ^ drawn).mean() >= RIM)
    rim = np.concatenate([figure[0], figure[-1], figure[:, 0], figure[:, -1]])
    return bool(rim.mean() >= RIM and (~figure).mean() >= INSIDE)
