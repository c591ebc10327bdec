"""What the command line of `python -m bench` asks for, and which options go together."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import typer

DEFAULT_COUNT = 4


class Subject(StrEnum):
    """What is measured."""

    calib = "calib"
    train = "train"
    look = "look"
    paper = "paper"
    stability = "stability"
    splitting = "split"  # a string has a method `split`
    palette = "palette"
    labels = "labels"


class Baseline(StrEnum):
    """What calibration is compared with, besides the nominal angles."""

    colmap = "colmap"


@dataclass(frozen=True)
class Chosen:
    """What the command line asks for."""

    subject: Subject
    cases: Path | None
    sprites: Path | None
    only: str
    count: int | None
    half: bool
    baseline: Baseline | None
    quick: bool
    seed: int
    peers: tuple[str, ...] = ()

    def check(self) -> None:
        """Refuse options of another subject.

        Raises:
            BadParameter: one of them is given.
        """
        training = self.subject in (Subject.train, Subject.paper)
        if self.half and (not training or self.cases is None):
            raise typer.BadParameter("--half belongs to `train --cases` and `paper --cases`")
        if self.baseline is not None and self.subject is not Subject.calib:
            raise typer.BadParameter("--baseline belongs to `calib`")
        if self.peers and self.subject is not Subject.train:
            raise typer.BadParameter("--peer belongs to `train`")
        if self.sprites is not None and self.subject not in (Subject.calib, Subject.splitting):
            raise typer.BadParameter("--sprites belongs to `calib` and `split`")
        alone = self.subject is Subject.calib and self.sprites is not None
        if alone and (self.cases is not None or self.baseline is not None):
            raise typer.BadParameter("--sprites goes without --cases and --baseline")
        of_colors = self.subject in (Subject.palette, Subject.labels)
        if of_colors and (self.only or self.count):
            raise typer.BadParameter("--only and --count do not belong to `palette` and `labels`")
        if self.cases is not None and self.subject is Subject.stability:
            raise typer.BadParameter("--cases does not belong to `stability`")
