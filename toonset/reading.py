"""Reading one foreign file whole: the same plain refusals for pictures, meshes and palettes."""

from __future__ import annotations

from pathlib import Path

from toonset.errors import ToonsetError

FOREIGN_FORMATS = (
    (b"PK\x03\x04", "a zip archive (or a Krita, OpenRaster or Office file)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"Rar!", "a RAR archive"),
    (b"%PDF", "a PDF"),
    (b"%!PS", "a PostScript file"),
    (b"8BPS", "a Photoshop file"),
    (b"gimp xcf", "a GIMP file"),
    (b"BLENDER", "a Blender file"),
    (b"Kaydara FBX", "an FBX file"),
    (b"glTF", "a glTF mesh"),
    (b"ply\n", "a PLY mesh"),
    (b"ply\r\n", "a PLY mesh"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"\x7fELF", "a program"),
)


def read_whole(
    path: Path, thing: str, error_type: type[ToonsetError], max_bytes: int = 512 * 2**20
) -> bytes:
    """Return the bytes of a regular file.

    Args:
        path: the file.
        thing: what is needed, for the message: "picture", "mesh", "palette".
        error_type: the error to raise.
        max_bytes: a longer file is refused before it is read.

    Raises:
        ToonsetError: as `error_type`: missing, a folder, a device, unreadable, empty, too long.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise error_type(f"{path}: is a folder, a {thing} file is needed; name the file in it")
        if not path.is_file():
            raise error_type(f"{path}: is no regular file; a {thing} file is needed")
        if size == 0:
            raise error_type(f"{path}: is empty (0 bytes); export the {thing} again")
        if size > max_bytes:
            raise error_type(
                f"{path}: {size / 2**20:.0f} MB, at most {max_bytes / 2**20:.0f} MB is read; "
                f"make the {thing} smaller"
            )
        return path.read_bytes()
    except FileNotFoundError as error:
        raise error_type(f"{path}: no such file; check the name of the {thing}") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise error_type(f"{path}: cannot be read ({reason}); check its permissions") from error


def describe(data: bytes) -> str:
    """Return what foreign bytes look like, for messages: "a zip archive", "text", ..."""
    for magic, description in FOREIGN_FORMATS:
        if data.startswith(magic):
            return description
    if data[4:8] == b"ftyp":
        return "a HEIC or AVIF picture, or a film"
    head = data[:1024]
    if b"<svg" in head:
        return "an SVG drawing"
    is_text = b"\0" not in head and sum(byte < 9 for byte in head) == 0
    return "text" if is_text else "of an unknown kind"
