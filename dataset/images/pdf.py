"""Draw the one page of a PDF, or of an Illustrator file, with pypdfium2, an optional package.

Source: pypdfium2 (Apache-2.0 or BSD-3-Clause), over Google's PDFium.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from PIL import Image

from toonset.errors import PictureError

MAGIC = b"%PDF"
INSTALL = "pip install 'toonset[pdf]'"
LONG_SIDE_PX = 3000  # of a page of curves: eight figures in a row are 300 px wide
MOST_SHARE = 0.25  # of the page: a picture that covers more says how fine the page is


def open_page(data: bytes, path: Path, max_pixels: int) -> Image.Image:
    """Return the page over white: as fine as the largest picture in it, or 3000 px of curves.

    Args:
        data: of the file.
        path: for messages.
        max_pixels: a page that would have more is refused before it is drawn.

    Raises:
        PictureError: pypdfium2 is missing; the file is damaged, locked, too large, or has not one
            page.
    """
    library = _library(path)
    try:
        document = library.PdfDocument(data)
    except library.PdfiumError as error:
        kind = "locked with a password" if "assword" in str(error) else "damaged or cut off"
        raise PictureError(f"{path}: the PDF is {kind}; save the page as PNG") from error
    with document:
        if len(document) != 1:
            raise PictureError(
                f"{path}: has {len(document)} pages; save the page that is meant as a PNG or a PDF"
            )
        try:
            return _drawn(document[0], path, max_pixels)
        except library.PdfiumError as error:
            raise PictureError(
                f"{path}: the PDF is damaged or cut off; save the page as PNG"
            ) from error


def _library(path: Path) -> Any:
    try:
        import pypdfium2
    except ImportError as error:
        raise PictureError(
            f"{path}: is a PDF, which needs pypdfium2: {INSTALL}; or save the page as PNG"
        ) from error
    return pypdfium2


def _drawn(page: Any, path: Path, max_pixels: int) -> Image.Image:
    width, height = page.get_size()
    scale = _scale(page, width, height)
    pixels = width * height * scale**2
    if not 1 <= pixels <= max_pixels:
        raise PictureError(
            f"{path}: a page of {pixels / 1e6:.4g} megapixels, 1 pixel to {max_pixels / 1e6:g} "
            "megapixels are read; save it as a smaller PNG"
        )
    image: Image.Image = page.render(scale=scale).to_pil()
    return image.convert("RGB")


def _scale(page: Any, width: float, height: float) -> float:
    """Return pixels per point: those of the page's largest picture, if it is large."""
    from pypdfium2.raw import FPDF_PAGEOBJ_IMAGE

    best, scale = MOST_SHARE * width * height, LONG_SIDE_PX / max(width, height, 1e-6)
    for picture in page.get_objects(filter=[FPDF_PAGEOBJ_IMAGE]):
        left, bottom, right, top = picture.get_bounds()
        area, size = (right - left) * (top - bottom), picture.get_px_size()
        if area > best:
            best, scale = area, math.sqrt(size[0] * size[1] / area)
    return scale * (1 - 1e-6)  # sizes are rounded up, and points are float32
