"""Collect all problems of a folder, where a reader stops at the first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from toonset.errors import ToonsetError, one_line
from toonset.json_file import SchemaProblems

Found = TypeVar("Found")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        where: the file, relative to the folder.
        what: what is wrong with it and what to do, on one line.
    """

    where: str
    what: str


@dataclass
class ProblemLog:
    """The problems of one folder, in the order in which they were found."""

    root: Path
    problems: list[Problem] = field(default_factory=list)

    def add(self, where: str, what: str) -> None:
        """Note a problem; what a file says may hold anything and is made printable."""
        self.problems.append(Problem(one_line(where), one_line(what)))

    def attempt(
        self, where: str, read: Callable[..., Found], *args: Any, **options: Any
    ) -> Found | None:
        """Return what a reader returns; note its refusal and return None.

        Args:
            where: the file or folder that is read, relative to the folder.
            read: raises a ToonsetError that begins with a path.
            args: of `read`.
            options: of `read`.
        """
        try:
            return read(*args, **options)
        except SchemaProblems as error:
            for problem in error.problems:
                self.add(where, f"{problem}; correct the file")
        except ToonsetError as error:
            self.add(*self._place(where, str(error)))
        return None

    def _place(self, where: str, text: str) -> tuple[str, str]:
        """Return the file that a message begins with, if it is the one that was read or in it."""
        if text.startswith(f"{self.root / where}: "):
            return where, text.removeprefix(f"{self.root / where}: ")
        name, _, what = text.removeprefix(f"{self.root}/").partition(": ")
        inside = text.startswith(f"{self.root}/") and name.startswith(where)
        return (name, what) if inside else (where, text)
