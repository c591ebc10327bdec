"""What the command line of `python -m lab.bench` asks for, and which options go together."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import typer

from toonset.errors import BundleError

DEFAULT_COUNT = 4


class Subject(StrEnum):
    """A subject that is measured."""

    calib = "calib"
    train = "train"
    look = "look"
    stability = "stability"
    splitting = "split"  # a string has a method `split`
    palette = "palette"
    labels = "labels"


@dataclass(frozen=True)
class Chosen:
    """Choices of the command line."""

    subject: Subject
    cases: Path | None = None
    sprites: Path | None = None
    only: str = ""
    count: int | None = None
    half: bool = False
    quick: bool = False
    seed: int = 0

    @property
    def none_of(self) -> BundleError:
        """Return the message for an unknown name."""
        return BundleError(f"no case's name contains {self.only!r}; correct --only")

    def check(self) -> None:
        """Refuse options of another subject.

        Raises:
            BadParameter: one of them is given.
        """
        of_colors = self.subject in (Subject.palette, Subject.labels)
        refused = {
            "--half belongs to `train --cases`": self.half
            and (self.subject is not Subject.train or self.cases is None),
            "--sprites belongs to `calib` and `split`": self.sprites is not None
            and self.subject not in (Subject.calib, Subject.splitting),
            "--sprites goes without --cases": self.subject is Subject.calib
            and self.sprites is not None
            and self.cases is not None,
            "--only and --count do not belong to `palette` and `labels`": of_colors
            and (self.only or self.count),
            "--cases does not belong to `stability`": self.cases is not None
            and self.subject is Subject.stability,
        }
        for words, wrong in refused.items():
            if wrong:
                raise typer.BadParameter(words)
