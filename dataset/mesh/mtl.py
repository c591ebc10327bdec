"""Read Wavefront MTL: what a material's colour, texture and opacity are, and where its files lie.

newmtl NAME
Kd r g b                  colour
map_Kd [options] FILE     its texture; -s and -o scale and move it
Ke r g b, map_Ke FILE     glow: the colour where Kd is black
d 0.5, Tr 0.5             opacity, or what lacks to it
map_d [options] FILE      opacity's texture: the alpha, or else the grey
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np

UNKNOWN_COLOR = (204, 204, 204)  # a face whose material is not described; trimesh's and Blender's
OPTIONS = {  # of a texture, and the most words that follow each
    **dict.fromkeys(("-blendu", "-blendv", "-bm", "-boost", "-cc", "-clamp", "-imfchan"), 1),
    **dict.fromkeys(("-texres", "-type"), 1),
    "-mm": 2,
    **dict.fromkeys(("-o", "-s", "-t"), 3),
}
SEVERAL = ("-mm", "-o", "-s", "-t")  # as many numbers as follow
MOST_FOLDERS = 16  # of a path that are tried

Color = tuple[int, ...]


@dataclass(frozen=True)
class Map:
    """A texture that a material names.

    Attributes:
        name: of its file, as written.
        scale, offset: of its coordinates, u and v.
    """

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Material:
    """A material; what is None is not said.

    Attributes:
        color: sRGB.
        glow: sRGB.
        opacity: 0 to 1.
        maps: by what they are of: `kd`, `ke`, `d`.
    """

    color: Color | None = None
    glow: Color | None = None
    opacity: float | None = None
    maps: tuple[tuple[str, Map], ...] = ()

    def map_of(self, what: str) -> Map | None:
        """Return the last texture of one kind."""
        return dict(self.maps).get(what)

    @property
    def shown_map(self) -> Map | None:
        """Return the texture of the colour that is shown."""
        own = self.map_of("kd")
        return self.map_of("ke") if own is None and self._glows else own

    @property
    def shown_color(self) -> Color:
        """Return the colour that is shown where no texture is."""
        if self._glows and self.glow is not None:
            return self.glow
        return UNKNOWN_COLOR if self.color is None else self.color

    @property
    def _glows(self) -> bool:
        dark = self.color is None or not any(self.color)
        shines = any(self.glow or ()) or self.map_of("ke") is not None
        return dark and self.map_of("kd") is None and shines


def read_mtl(data: bytes) -> dict[str, Material]:
    """Return the materials of a library by name; lines that say nothing we know are passed over."""
    found: dict[str, Material] = {}
    name = ""
    is_tr = False  # `d` goes before `Tr`, whichever comes first
    for line in text_of(data).splitlines():
        key, _, rest = line.strip().replace("\t", " ").partition(" ")
        key, rest = key.lower(), rest.strip()
        own = found.get(name, Material())
        if key == "newmtl":
            name, is_tr = rest, False
            found[name] = Material()
        elif key == "kd":
            found[name] = replace(own, color=_rgb(rest.split()))
        elif key == "ke":
            found[name] = replace(own, glow=_rgb(rest.split()))
        elif key in ("d", "tr"):
            opacity = _opacity(key, rest.split())
            if opacity is not None and (key == "d" or own.opacity is None or is_tr):
                is_tr = key == "tr"
                found[name] = replace(own, opacity=opacity)
        elif key in ("map_kd", "map_ke", "map_d") and (named := read_map(rest)) is not None:
            found[name] = replace(own, maps=(*own.maps, (key.removeprefix("map_"), named)))
    return found


def text_of(data: bytes) -> str:
    """Return text in UTF-8, UTF-16 with its mark, or else of an 8-bit encoding as Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_map(text: str) -> Map | None:
    """Return a texture of what follows its keyword: options, then a name that may hold spaces."""
    numbers: dict[str, tuple[float, float]] = {}
    rest = text.strip()
    while rest.startswith("-"):
        option, _, after = rest.partition(" ")
        if option.lower() not in OPTIONS:
            break
        words = after.split()
        count = _numbers_in(option.lower(), words)
        if option.lower() in ("-o", "-s"):
            given = [float(word) for word in words[:count]] + ([1.0] if option == "-s" else [0.0])
            numbers[option.lower()] = (given[0], given[1])
        rest = after.strip()
        for word in words[:count]:
            rest = rest.removeprefix(word).strip()
    name = rest.strip("\"'")
    if not name:
        return None
    return Map(name, numbers.get("-s", (1.0, 1.0)), numbers.get("-o", (0.0, 0.0)))


def library_names(text: str, is_there: Callable[[str], bool]) -> list[str]:
    """Return the libraries that follow `mtllib`: one whose name may hold spaces, or several."""
    whole = text.strip().strip("\"'")
    if whole and is_there(whole):
        return [whole]
    found: list[str] = []
    words: list[str] = []
    for word in text.split(" #")[0].split():
        words.append(word)
        if word.lower().rstrip("\"'").endswith(".mtl"):
            found.append(" ".join(words).strip("\"'"))
            words = []
    return [*found, *([" ".join(words)] if words else [])]


def _numbers_in(option: str, words: Sequence[str]) -> int:
    """Return how many words belong to an option."""
    most = OPTIONS[option]
    if option not in SEVERAL:
        return min(most, len(words))
    count = 0
    while count < min(most, len(words)) and _is_number(words[count]):
        count += 1
    return count


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _opacity(key: str, words: Sequence[str]) -> float | None:
    words = [word for word in words if word != "-halo"]
    if not words or not _is_number(words[0]):
        return None
    return float(words[0]) if key == "d" else 1 - float(words[0])


def _rgb(words: list[str]) -> Color:
    try:
        red, green, blue = (round(255 * min(max(float(word), 0.0), 1.0)) for word in words[:3])
    except ValueError:  # too few, no numbers, or NaN
        return UNKNOWN_COLOR
    return red, green, blue


def beside(mesh_path: Path, name: str) -> Path | None:
    """Return the file below the mesh's own folder that a name means; None if there is none."""
    folder = os.path.realpath(mesh_path.parent)

    def names_in(place: str) -> Sequence[str]:
        try:
            return os.listdir(os.path.join(folder, place))
        except OSError:
            return ()

    for found in matches(name, names_in):
        file = os.path.realpath(os.path.join(folder, found))
        if os.path.commonpath([folder, file]) == folder and os.path.isfile(file):
            return Path(file)
    return None


def matches(name: str, names_in: Callable[[str], Sequence[str]]) -> Iterator[str]:
    """Yield the paths below a folder that a name may mean, the likeliest first.

    Args:
        name: as a file has it.
        names_in: returns the names in a folder below that folder, "" for itself.
    """
    for written in dict.fromkeys([name, unquote(name)]):
        for end in ends_of(written):
            found = ""
            for part in end:
                names = names_in(found)
                own = part if part in names else _alike(part, names)
                if own is None:
                    break
                found = f"{found}/{own}" if found else own
            else:
                yield found


def ends_of(name: str) -> Iterator[list[str]]:
    """Yield the ends of a path, folder by folder, the longest first; nothing of one to no file."""
    path = name.strip().strip("\"'").replace("\\", "/")
    parts = [part for part in path.split("/") if part not in ("", ".")]
    if "\0" in name or not parts:
        return
    for start in range(max(0, len(parts) - MOST_FOLDERS), len(parts)):
        if ".." not in parts[start:]:
            yield parts[start:]


def _alike(name: str, names: Sequence[str]) -> str | None:
    """Return the name that differs in capitals or in how its accents are written only."""
    wanted = _plain(name)
    return next((one for one in sorted(names) if _plain(one) == wanted), None)


def _plain(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
