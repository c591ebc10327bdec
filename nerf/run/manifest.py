"""manifest.json: the SHA-256 of every file of a run folder, so that damage never passes for data.

    {"schema": "toonset-run/1", "files": {"config.json": {"bytes": 812, "sha256": "..."}, ...}}

Names are relative to the folder, which may be moved anywhere.
"""

from __future__ import annotations

from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from toonset.errors import BundleError, one_line
from toonset.json_file import read_json, validated
from toonset.read import read_whole, schema_version
from toonset.write import write_json

FILE = "manifest.json"
SCHEMA, VERSION = "toonset-run", 1
WRITTEN = (
    *("model.safetensors", "config.json", "metrics.json", "history.csv", "preview.png"),
    *("drawings.png", "paint.png", "drawings.safetensors", FILE),
)


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore")
    bytes: int = Field(ge=0)
    sha256: str = Field(pattern="^[0-9a-f]{64}$")


class _Manifest(BaseModel):
    model_config = ConfigDict(extra="ignore")
    files: dict[str, _Entry] = Field(max_length=1000)


def write_manifest(folder: Path) -> None:
    """Write the manifest of all files that lie in a folder."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != FILE)
    entries = {path.name: entry_of(path.read_bytes()) for path in files}
    write_json(folder / FILE, {"schema": f"{SCHEMA}/{VERSION}", "files": entries})


def entry_of(data: bytes) -> dict[str, int | str]:
    """Return what a manifest says of a file with these bytes."""
    return {"bytes": len(data), "sha256": sha256(data).hexdigest()}


def check_manifest(folder: Path, names: Iterable[str] | None = None) -> None:
    """Refuse files that are not those that were written.

    Args:
        folder: a run folder.
        names: files to look at; None: all that the manifest names.

    Raises:
        BundleError: the manifest cannot be read, or a file is missing, not named in it, or changed.
    """
    file = folder / FILE
    content = read_json(file)
    schema_version(content, SCHEMA, VERSION, str(file), BundleError)
    entries = validated(_Manifest, content, file).files
    for name in entries if names is None else names:
        if name not in entries or Path(name).name != name:
            raise BundleError(f"{file}: {one_line(name)!r} is no file of a run; train again")
        found = entry_of(read_whole(folder / name, "run", BundleError))
        if found != entries[name].model_dump():
            raise BundleError(
                f"{folder / name}: is not the file that training wrote ({FILE} has another "
                "SHA-256); restore it or train again"
            )
