"""What results are made of: input files by role, name and SHA-256, and options that were given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class InputFile:
    """A file that a result depends on.

    Attributes:
        role: "sheet", "view", "mesh", ...
        name: without its folder, so that results are the same wherever it lies.
        sha256: of its bytes.
    """

    role: str
    name: str
    sha256: str

    @classmethod
    def of(cls, role: str, path: Path) -> InputFile:
        """Return the record of a file on disk."""
        return cls(role, path.name, sha256(path.read_bytes()).hexdigest())


@dataclass(frozen=True, eq=False)
class Origin:
    """Where the views of one or more sheets come from.

    Attributes:
        files: in the order in which they were given.
        options: how the sheets were cut, as typed; only what was given.
    """

    files: tuple[InputFile, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
