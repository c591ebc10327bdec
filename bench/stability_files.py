"""The finished steps of a stability run as plain data, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from toonset.bench.calib import ViewError
from toonset.bench.stability import SheetResult, StepResult
from toonset.bench.stability_sweeps import SWEEPS
from toonset.errors import BundleError

FORMAT = 1


@dataclass(frozen=True)
class RunKey:
    """What finished steps depend on: they serve a run with the same key, no other."""

    version: str
    seed: int
    count: int


def as_plain(key: RunKey, steps: Sequence[StepResult]) -> dict[str, Any]:
    """Return the steps as data for JSON; errors in radians, seconds as measured."""
    return {"format": FORMAT, **asdict(key), "steps": [asdict(step) for step in steps]}


def from_plain(data: Any, key: RunKey, place: str) -> list[StepResult]:
    """Return the finished steps.

    Args:
        data: as `as_plain` gave it.
        key: of the run that wants to go on.
        place: where the data came from, for messages.

    Raises:
        BundleError: the data belong to a run with another key, or are no steps at all.
    """
    try:
        found = RunKey(data["version"], data["seed"], data["count"])
        steps = [_step(step) for step in data["steps"]]
        known = data["format"] == FORMAT
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError(
            f"{place}: holds no steps of a stability run; pass --force to start afresh"
        ) from error
    if not known or found != key:
        raise BundleError(
            f"{place}: steps of {found}, this run is {key}; pass --force to start afresh, or "
            "choose another -o"
        )
    return steps


def in_table_order(steps: Sequence[StepResult]) -> list[StepResult]:
    """Return the steps sorted as the sweeps and their steps are listed; unknown ones left out."""
    listed = [(sweep.name, str(step)) for sweep in SWEEPS for step in sweep.steps]
    found = {(step.sweep, step.step): step for step in steps}
    return [found[name] for name in listed if name in found]


def _step(data: Any) -> StepResult:
    sheets = tuple(
        SheetResult(
            tuple(
                ViewError(float(view["raw"]), float(view["modulo_twin"]), str(view["verdict"]))
                for view in sheet["views"]
            ),
            float(sheet["seconds"]),
            str(sheet["note"]),
        )
        for sheet in data["sheets"]
    )
    return StepResult(str(data["sweep"]), str(data["step"]), sheets)
