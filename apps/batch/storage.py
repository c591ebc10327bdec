"""Reach inputs and results that lie on disk, or behind a URL that fsspec can open.

A URL's scheme says by which package: file:// and memory:// need none, s3:// s3fs, gs:// gcsfs.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from toonset.errors import SheetError, ToonsetError, one_line

URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
MANY = 500  # hashes that are kept until the table takes them
CHANGING = (  # names of servers, letters and digits only, for what changes with a file
    *("etag", "generation", "mtime", "lastmodified", "modified"),
    *("md5hash", "contentmd5", "digest", "checksum"),
)
LONGEST = 100  # characters of a name that a copy gets


def is_url(place: str) -> bool:
    """Return whether a place is a URL rather than a path."""
    return URL.match(place) is not None


def find(pattern: str) -> list[str]:
    """Return the files behind a URL with wildcards, in order.

    Raises:
        ToonsetError: it cannot be reached.
    """
    with _reached(pattern) as (files, path):
        return [files.unstrip_protocol(found) for found in sorted(files.glob(path))]


def keys_behind(url: str, names: Sequence[str]) -> dict[str, str]:
    """Return the keys that stamps behind a URL hold, by their names; of those that are there.

    Raises:
        ToonsetError: it cannot be reached.
    """
    if not names:
        return {}
    with _reached(url) as (files, path):
        at = {f"{path.rstrip('/')}/{name}": name for name in names}
        found = files.cat([*at], on_error="return")
        keys = {}
        for place, data in found.items():
            if isinstance(data, FileNotFoundError):
                continue
            if isinstance(data, Exception):
                raise data
            with contextlib.suppress(ValueError, TypeError, KeyError):  # it is cut short
                keys[at[place]] = str(json.loads(data)["key"])
        return keys


def looks(place: str) -> str | None:
    """Return what changes when a file or folder does; None if there is nothing.

    Of a path the size, time and number of every file, of a URL what its server says of it.

    Raises:
        ToonsetError: a URL cannot be reached.
    """
    if is_url(place):
        with _reached(place) as (files, path):
            if not files.exists(path):
                return None
            if files.isdir(path):
                found = files.find(path, detail=True)
            else:
                found = {name: files.info(name) for name in _whole(files, path)}
            base = path.rstrip("/").rsplit("/", 1)[0]
            told = [[n.removeprefix(base), _told(files, n, found[n])] for n in sorted(found)]
            return json.dumps(told)
    try:
        return json.dumps([[str(file), *_stat(file)] for file in _files(Path(place))])
    except OSError:
        return None


def _told(files: Any, path: str, info: dict[str, Any]) -> list[str]:
    """Return what a server says of a file that changes with it; where that is nothing, its hash."""
    plain = {re.sub(r"[^a-z0-9]", "", name.lower()): str(value) for name, value in info.items()}
    told = [f"{name} {plain[name]}" for name in CHANGING if plain.get(name, "None") != "None"]
    size = f"size {plain.get('size')}"
    return [size, *(told or [hashlib.sha256(files.cat_file(path)).hexdigest()])]


def content_hash(place: str) -> str:
    """Return the SHA-256 of a file's bytes; of a folder, or a mesh with materials, names and bytes.

    Of a URL it is the hash of what its server says, for the bytes are not here.

    Raises:
        OSError: it cannot be read.
        ToonsetError: a URL cannot be reached.
    """
    if is_url(place):
        return hashlib.sha256((looks(place) or "").encode()).hexdigest()
    root, found = Path(place), hashlib.sha256()
    files = _files(root)
    if files == [root]:
        return _sha256(root)
    base = root if root.is_dir() else root.parent
    for file in files:
        name = Path(os.path.relpath(file, base)).as_posix()
        found.update(f"{name}\0{_sha256(file)}\n".encode())
    return found.hexdigest()


def fetch(url: str, folder: Path, without: str = "") -> Path:
    """Copy what is behind a URL, a file or a folder, into a folder; return where it lies.

    Args:
        url: of it.
        folder: to put it in.
        without: a folder in it that is left; "": none.

    Raises:
        ToonsetError: it cannot be reached.
    """
    with _reached(url) as (files, path):
        root = path.rstrip("/")
        place = folder / (file_name(url) or "sheet")
        folder.mkdir(parents=True, exist_ok=True)
        if not files.isdir(path):
            files.get(path, str(place))
            for there in _whole(files, path)[1:]:
                here = folder / there.removeprefix(f"{root.rsplit('/', 1)[0]}/")
                here.parent.mkdir(parents=True, exist_ok=True)
                files.get(there, str(here))
            return place
        found = {name.removeprefix(f"{root}/"): name for name in files.find(path)}
        wanted = [name for name in found if not (without and name.startswith(f"{without}/"))]
        for parent in {(place / name).parent for name in wanted}:
            parent.mkdir(parents=True, exist_ok=True)
        files.get([found[name] for name in wanted], [str(place / name) for name in wanted])
        return place


def push(folder: Path, url: str, last: tuple[str, ...] = ()) -> None:
    """Copy a folder's files behind a URL, some of them when all others are there.

    Raises:
        ToonsetError: it cannot be reached.
    """
    with _reached(url) as (files, path):
        names = [file.relative_to(folder).as_posix() for file in _files(folder)]
        there = files.find(path) if files.exists(path) else []
        gone = {name.removeprefix(path.rstrip("/") + "/") for name in there} - set(names)
        early = [name for name in last if name in {*names, *gone}]
        files_at = {name: f"{path.rstrip('/')}/{name}" for name in {*names, *gone}}
        for name in (*early, *sorted(gone)):  # first what says that all is there
            with contextlib.suppress(FileNotFoundError):
                files.rm_file(files_at[name])
        for name in sorted(names, key=lambda name: (name in last, name)):
            files.makedirs(files_at[name].rsplit("/", 1)[0], exist_ok=True)
            files.put_file(str(folder / name), files_at[name])


def file_name(place: str) -> str:
    """Return the last part of a path or URL, without what a web address has behind it."""
    path = re.split(r"[?#]", place)[0] if re.match("https?://", place, re.IGNORECASE) else place
    return path.rstrip("/").rsplit("/", 1)[-1][-LONGEST:]


def _whole(files: Any, path: str) -> list[str]:
    """Return a file behind a URL, and, of a mesh, those in its folder that it is read with."""
    from toonset.dataset.mesh.obj import material_files_in

    if not path.lower().endswith(".obj"):
        return [path]
    folder = path.rsplit("/", 1)[0]

    def names_in(place: str) -> list[str]:
        try:
            found = files.ls(f"{folder}/{place}".rstrip("/"), detail=False)
        except (OSError, NotImplementedError):
            return []
        return [there.rstrip("/").rsplit("/", 1)[-1] for there in found]

    def is_file(place: str) -> bool:
        return bool(files.isfile(f"{folder}/{place}"))

    def read(place: str) -> bytes:
        data: bytes = files.cat_file(f"{folder}/{place}")
        return data

    found = material_files_in(files.cat_file(path), names_in, is_file, read)
    return [path, *(f"{folder}/{place}" for place in found)]


def _files(root: Path) -> list[Path]:
    """Return a file with those that it names, or all files below a folder but hidden ones."""
    if not root.is_dir():
        root.stat()
        return _with_materials(root)
    found = []
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        found += [Path(folder, name) for name in sorted(names) if not name.startswith(".")]
    return [file for file in found if file.is_file()]


def _with_materials(file: Path) -> list[Path]:
    """Return a file, and of a mesh those in its folder that it is read with."""
    from toonset.dataset.mesh.obj import material_files_beside

    return [file, *(material_files_beside(file) if file.suffix.lower() == ".obj" else ())]


def _stat(file: Path) -> tuple[int, int, int]:
    stat = file.stat()
    return stat.st_size, stat.st_mtime_ns, stat.st_ino


def _sha256(file: Path) -> str:
    with open(file, "rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


@contextlib.contextmanager
def _reached(url: str) -> Iterator[tuple[Any, str]]:
    """Yield the file system behind a URL, and its path there; one line for what goes wrong."""
    import fsspec

    try:
        yield fsspec.core.url_to_fs(url)
    except ToonsetError:
        raise
    except ImportError as error:
        raise ToonsetError(f"{url}: {one_line(error)}") from error
    except Exception as error:  # each package has its own
        raise ToonsetError(f"{url}: cannot be reached ({one_line(error)})") from error


class Kept(Protocol):
    """What keeps hashes from run to run."""

    def hash_of(self, path: str, looks: str) -> str | None:
        """Return the hash of what still looks as it did when it was hashed."""

    def keep_hashes(self, found: Iterable[tuple[str, str, str]]) -> None:
        """Keep paths, how they look and their hashes."""


class Hashes:
    """Hashes of inputs; a file that looks as it did in an earlier run is not read again."""

    def __init__(self, table: Kept) -> None:
        """Keep them in a table."""
        self._table, self._new = table, dict[str, tuple[str, str]]()
        self._known = dict[str, str]()  # of this run

    def __call__(self, place: str) -> str:
        """Return the hash of a file's or folder's content.

        Raises:
            SheetError: it cannot be read.
        """
        if place in self._known:
            return self._known[place]
        seen = looks(place)
        if seen is None:
            raise SheetError(f"{place}: does not exist; check the name")
        known = self._table.hash_of(place, seen)
        if known is not None:
            self._known[place] = known
            return known
        try:
            found = content_hash(place)
        except OSError as error:
            reason = error.strerror or str(error)
            raise SheetError(f"{place}: cannot be read ({reason}); check permissions") from error
        self._new[place], self._known[place] = (seen, found), found
        if len(self._new) >= MANY:
            self.keep()
        return found

    def keep(self) -> None:
        """Write the new ones to the table."""
        self._table.keep_hashes((place, *new) for place, new in self._new.items())
        self._new.clear()
