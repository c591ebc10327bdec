"""A page of the atlas of failures: one property of a sheet, in steps from harmless to extreme."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from bench.stability.sheet import Step


@dataclass(frozen=True)
class Page:
    """One way of failing: a property and its steps.

    Attributes:
        name: for --only and the tables.
        axis: what the steps are, with unit, for the picture.
        steps: from harmless to extreme.
        quick: those of a quick run.
        about: in a sentence for the report.
        base: the step that is the base sheet, tried once for all pages; None: no step is.
    """

    name: str
    axis: str
    steps: tuple[Step, ...]
    quick: tuple[Step, ...]
    about: str
    base: Step | None


Chosen = TypeVar("Chosen", bound=Page)


def chosen(only: str, pages: Iterable[Chosen], *, quick: bool) -> list[tuple[Chosen, Step]]:
    """Return the steps to run of the pages whose name contains `only`."""
    picked = (page for page in pages if only in page.name)
    return [(page, step) for page in picked for step in (page.quick if quick else page.steps)]
