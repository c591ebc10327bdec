"""The finished steps of a stability run as plain data, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bench.atlas.run import Counts, Result, TriedStepResult, all_pages
from bench.atlas.training import Tried
from bench.calib.measure import ViewError
from bench.stability.steps import SheetResult, StepResult
from toonset.errors import BundleError

FORMAT = 3


@dataclass(frozen=True)
class RunKey:
    """What finished steps depend on: they serve a run with the same key, no other."""

    version: str
    seed: int
    counts: Counts


def as_plain(key: RunKey, steps: Sequence[Result]) -> dict[str, Any]:
    """Return the steps as data for JSON; errors in radians, seconds as measured."""
    return {"format": FORMAT, **asdict(key), "steps": [asdict(step) for step in steps]}


def from_plain(data: Any, key: RunKey, place: str) -> list[Result]:
    """Return the finished steps.

    Args:
        data: as `as_plain` gave it.
        key: of the run that wants to go on.
        place: where the data came from, for messages.

    Raises:
        BundleError: the data belong to a run with another key, or are no steps at all.
    """
    try:
        known = data["format"] == FORMAT
        found = RunKey(data["version"], data["seed"], Counts(**data["counts"])) if known else None
        steps = [_step(step) for step in data["steps"]] if known else []
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError(
            f"{place}: holds no steps of a stability run; pass --force to start afresh"
        ) from error
    if found != key:
        raise BundleError(
            f"{place}: steps of {found or 'an older toonset'}, this run is {key}; pass --force to "
            "start afresh, or choose another -o"
        )
    return steps


def name_of(step: Result) -> tuple[str, str]:
    """Return a step's page and step."""
    return (step.sweep if isinstance(step, StepResult) else step.page), step.step


def in_table_order(steps: Sequence[Result]) -> list[Result]:
    """Return the steps sorted as the pages and their steps are listed; unknown ones left out."""
    listed = [(page.name, str(step)) for page in all_pages() for step in page.steps]
    found = {name_of(step): step for step in steps}
    return [found[name] for name in listed if name in found]


def _step(data: Any) -> Result:
    if "page" in data:
        tried = tuple(_tried(one) for one in data["tried"])
        return TriedStepResult(str(data["page"]), str(data["step"]), tried)
    sheets = tuple(
        SheetResult(
            tuple(
                ViewError(float(view["raw"]), float(view["modulo_twin"]), str(view["verdict"]))
                for view in sheet["views"]
            ),
            float(sheet["seconds"]),
            str(sheet["note"]),
            tuple(map(str, sheet["reasons"])),
        )
        for sheet in data["sheets"]
    )
    return StepResult(str(data["sweep"]), str(data["step"]), sheets)


def _tried(data: Any) -> Tried:
    return Tried(
        int(data["seed"]),
        float(data["figure"]),
        str(data["voice"]),
        str(data["words"]),
        {str(name): float(value) for name, value in data["evidence"].items()},
        float(data["seconds"]),
    )
