"""Take the merged picture out of the zip files of Krita (.kra) and OpenRaster (.ora).

Source: OpenRaster specification 0.0.5 (freedesktop.org), "mergedimage.png"; Krita writes the same.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path

from toonset.errors import PictureError

MAGIC = b"PK\x03\x04"
MERGED = "mergedimage.png"
MAX_BYTES = 512 * 2**20  # of it unpacked, as of any picture file
OTHERS = {
    "maindoc.xml": "a Krita file",
    "stack.xml": "an OpenRaster file",
    "Document.archive": "a Procreate file",
    "[Content_Types].xml": "an Office file",
    "content.xml": "an OpenDocument file",
}


def merged_png(data: bytes, path: Path) -> bytes:
    """Return the PNG of all layers together that a Krita or OpenRaster file holds.

    Raises:
        PictureError: another zip, one without that picture, a damaged one, or a picture that is
            larger than any that is read.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = set(archive.namelist())
            if MERGED not in names:
                kind = next((said for name, said in OTHERS.items() if name in names), None)
                raise PictureError(
                    f"{path}: is {kind or 'a zip archive'} without a picture of all its layers "
                    f"({MERGED}); save it as PNG"
                )
            if archive.getinfo(MERGED).file_size > MAX_BYTES:
                raise _too_large(path)
            with archive.open(MERGED) as file:
                found = file.read(MAX_BYTES + 1)
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, ValueError) as error:
        raise PictureError(
            f"{path}: the Krita, OpenRaster or zip file is damaged or cut off; save it again"
        ) from error
    except (RuntimeError, NotImplementedError) as error:  # a password, a packing of its own
        raise PictureError(f"{path}: is a locked zip archive; save it as PNG") from error
    if len(found) > MAX_BYTES:  # it announced less
        raise _too_large(path)
    return found


def _too_large(path: Path) -> PictureError:
    return PictureError(
        f"{path}: its {MERGED} unpacks to more than {MAX_BYTES / 2**20:.0f} MB; scale the picture "
        "down"
    )
