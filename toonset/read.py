"""Read foreign files strictly: whole files of bounded size, JSON, and what a file says that it is.

JSON that two readers could understand differently is refused. RFC 8259 leaves open what a repeated
key means, how long numbers and how deep nestings may be, and Python's own reader takes NaN and
Infinity, which are no JSON. None of these occur in what toonset and its neighbours write, so a file
that holds one is damaged or hostile.

A file names its schema as "NAME/MAJOR" or "NAME/MAJOR.MINOR" under `schema`. Within a major version
keys may be added, never changed or taken away; a reader takes any minor one.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from toonset.errors import ToonsetError, printable
from toonset.lock import settle

FOREIGN_FORMATS = (
    (b"PK\x03\x04", "a zip archive (or a Krita, OpenRaster or Office file)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive"),
    (b"Rar!", "a RAR archive"),
    (b"%PDF", "a PDF"),
    (b"%!PS", "a PostScript file"),
    (b"8BPS", "a Photoshop file"),
    (b"gimp xcf", "a GIMP file"),
    (b"CSFCHUNK", "a Clip Studio Paint file"),
    (b"SAI-CANVAS", "a PaintTool SAI 2 file"),
    (b"mdipack", "a MediBang Paint file"),
    (b"PDN3", "a paint.net file"),
    (b"\0\xffKSA", "an Affinity file"),
    (b"v/1\x01", "an OpenEXR picture"),
    (b"#?RADIANCE", "a Radiance HDR picture"),
    (b"\xff\x0a", "a JPEG XL picture"),
    (b"\0\0\0\x0cJXL ", "a JPEG XL picture"),
    (b"\0\0\0\x0cjP  ", "a JPEG 2000 picture"),
    (b"\xff\x4f\xff\x51", "a JPEG 2000 picture"),
    (b"DDS ", "a DDS texture"),
    (b"qoif", "a QOI picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"II+\0", "a BigTIFF picture"),
    (b"MM\0+", "a BigTIFF picture"),
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
FTYP_BRANDS = {  # the first three letters; mif1 and msf1 are HEIF, as phones write it
    **dict.fromkeys((b"hei", b"hev", b"mif", b"msf"), "a HEIC picture"),
    b"avi": "an AVIF picture",
    b"crx": "a camera's raw picture",
}
UNKNOWN = "of an unknown kind"
TGA_END = b"TRUEVISION-XFILE.\0"
ASEPRITE, ASEPRITE_FRAME = b"\xe0\xa5", b"\xfa\xf1"
MAX_DEPTH = 64  # camera files nest eight deep
LARGEST_INT = 2**63  # beyond, other programs' integers end
MAX_DIGITS = 400  # as a float's longest; Python itself refuses 4300
LONE = re.compile("[\ud800-\udfff]")  # pairs are one character once they are read
BOM = b"\xef\xbb\xbf"


def check_there(
    paths: Iterable[str | Path | None], thing: str, error_type: type[ToonsetError]
) -> None:
    """Refuse files that are not there, before any work; what else is wrong their reader says.

    Args:
        paths: the files or folders; None: not given.
        thing: what they are, for the message, as of `read_whole`.
        error_type: the error to raise.

    Raises:
        ToonsetError: as `error_type`: a file is not there.
    """
    for path in (Path(one) for one in paths if one is not None):
        settle(path)
        try:
            path.stat()
        except FileNotFoundError as error:
            raise error_type(_missing(path, thing)) from error
        except (OSError, ValueError):
            continue


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
    settle(path)
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise error_type(f"{path}: is a folder, a {thing} file is needed; name the file in it")
        if not path.is_file():
            raise error_type(f"{path}: is no regular file; give a {thing} file")
        if size == 0:
            raise error_type(f"{path}: is empty (0 bytes); export the {thing} again")
        if size > max_bytes:
            raise error_type(
                f"{path}: {size / 2**20:.1f} MB, at most {max_bytes / 2**20:.0f} MB is read; "
                f"make the {thing} smaller"
            )
        return path.read_bytes()
    except FileNotFoundError as error:
        raise error_type(_missing(path, thing)) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise error_type(f"{path}: cannot be read ({reason}); check its permissions") from error


def describe(data: bytes) -> str:
    """Return what foreign bytes look like, for messages: "a zip archive", "text", ..."""
    for magic, description in FOREIGN_FORMATS:
        if data.startswith(magic):
            return description
    if data[4:8] == b"ftyp":
        return FTYP_BRANDS.get(data[8:11], "a film")
    if data.endswith(TGA_END):
        return "a TGA picture"
    if data[4:6] == ASEPRITE and data[132:134] == ASEPRITE_FRAME:
        return "an Aseprite file"
    head = data[:1024]
    if b"<svg" in head:
        return "an SVG drawing"
    is_text = b"\0" not in head and sum(byte < 9 for byte in head) == 0
    return "text" if is_text else UNKNOWN


def parse_json(data: bytes, where: str, error_type: type[ToonsetError]) -> Any:
    """Return the content of a JSON text in UTF-8 (with or without byte order mark).

    Args:
        data: the text's bytes.
        where: the file, for messages.
        error_type: the error to raise.

    Raises:
        ToonsetError: as `error_type`: no JSON, no UTF-8, a repeated key, half a character, a number
            that is not finite or has more than 63 bits, or a nesting deeper than 64.
    """
    try:
        text = data.removeprefix(BOM).decode("utf-8")
        value = json.loads(text, object_pairs_hook=_object, parse_int=_whole)
        _check(value)
    except RecursionError as error:
        raise error_type(
            f"{where}: is nested deeper than {MAX_DEPTH}; write it flatter, as toonset does"
        ) from error
    except UnicodeDecodeError as error:
        place = f"byte {error.start} is no UTF-8"
        raise error_type(f"{where}: is no valid JSON ({place}); save it as UTF-8") from error
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise error_type(f"{where}: is no valid JSON ({reason}); write it again") from error
    return value


def _missing(path: Path | None, thing: str) -> str:
    return f"{path}: no such file; check the name of the {thing}"


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {twice[:40]!r} is there twice")
    return found


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _check(value: Any) -> None:
    """Refuse numbers that are not finite or too long, half characters, deep nesting; say where."""
    pending: list[tuple[tuple[object, ...], Any]] = [((), {"the whole": value})]
    while pending:
        path, holder = pending.pop()
        inner = []
        for key, item in holder.items() if isinstance(holder, dict) else enumerate(holder):
            if not (_is_text(key) and _is_text(item)):
                raise ValueError(f"{_place((*path, key))} holds half a character")
            if isinstance(item, dict | list):
                inner.append(((*path, key), item))
            elif isinstance(item, float) and not math.isfinite(item):
                raise ValueError(f"{_place((*path, key))} is {item}, a finite number is needed")
            elif isinstance(item, int) and abs(item) >= LARGEST_INT:
                raise ValueError(f"{_place((*path, key))} has more than 63 bits")
        if inner and len(path) >= MAX_DEPTH:
            raise RecursionError
        pending += reversed(inner)


def _is_text(value: object) -> bool:
    """Return False for a text that has no UTF-8: an escaped surrogate without its other half."""
    return not isinstance(value, str) or value.isascii() or not LONE.search(value)


def _place(path: tuple[object, ...]) -> str:
    return printable(".".join(str(part)[:40] for part in path[1:] or path))


def schema_version(
    content: Any, name: str, newest: int, where: str, error_type: type[ToonsetError]
) -> int | None:
    """Return the major version that a file's `schema` states, None where it states none.

    Args:
        content: of the file.
        name: of the schema that is meant, e.g. "toonset-calibration".
        newest: the highest major version that is understood.
        where: the file, for messages.
        error_type: the error to raise.

    Raises:
        ToonsetError: as `error_type`: another schema, or one of a newer toonset.
    """
    stated = content.get("schema") if isinstance(content, dict) else None
    if stated is None:
        return None
    match = re.fullmatch(rf"{name}/([1-9]\d{{0,3}})(\.\d{{1,4}})?", str(stated), re.ASCII)
    if match is None:
        raise error_type(
            f"{where}: schema {str(stated)[:60]!r}, '{name}/{newest}' is needed; write it again"
        )
    major = int(match[1])
    if major > newest:
        raise error_type(
            f"{where}: schema '{match[0]}' is newer than this toonset, which reads up to "
            f"'{name}/{newest}'; update toonset"
        )
    return major
