"""Finished runs of a training bench as plain data, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from bench.train.plan import PREPARATIONS, Job
from bench.train.run import RunResult, Seen
from toonset.errors import BundleError

FORMAT = 2


def as_plain(runs: Sequence[tuple[dict[str, Any], RunResult]], version: str) -> dict[str, Any]:
    """Return the runs with their jobs' identities as data for JSON."""
    listed = [{"job": identity, "found": asdict(found)} for identity, found in runs]
    return {"format": FORMAT, "version": version, "runs": listed}


def from_plain(data: Any, version: str, place: str) -> list[tuple[dict[str, Any], RunResult]]:
    """Return the runs of an earlier bench.

    Args:
        data: as `as_plain` gave it.
        version: of the toonset that wants to go on.
        place: where the data came from, for messages.

    Raises:
        BundleError: another version made them, or they are no runs at all.
    """
    try:
        known = (data["format"], data["version"]) == (FORMAT, version)
        runs = [(dict(run["job"]), _result(run["found"])) for run in data["runs"]]
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError(
            f"{place}: holds no runs of a training bench; pass --force to start afresh"
        ) from error
    if not known:
        raise BundleError(
            f"{place}: was made by toonset {data['version']}, this is {version}; pass --force to "
            "start afresh, or choose another -o"
        )
    return runs


def missing(jobs: Sequence[Job], done: Sequence[tuple[dict[str, Any], RunResult]]) -> list[Job]:
    """Return the jobs that no finished run answers."""
    known = [identity for identity, _ in done]
    return [job for job in jobs if job.identity not in known]


def _result(data: Any) -> RunResult:
    return RunResult(
        group=str(data["group"]),
        method=str(data["method"]),
        case=str(data["case"]),
        seed=int(data["seed"]),
        figures={str(k): None if v is None else float(v) for k, v in data["figures"].items()},
        seconds=float(data["seconds"]),
        cpu_seconds=float(data["cpu_seconds"]),
        render_seconds=float(data["render_seconds"]),
        parameters=int(data["parameters"]),
        curve=tuple(_seen(point) for point in data["curve"]),
        acted=tuple(step for step in PREPARATIONS if step in data["acted"]),
        note=str(data["note"]),
        model_bytes=int(data["model_bytes"]),
    )


def _seen(data: Any) -> Seen:
    return Seen(float(data["seconds"]), float(data["cpu_seconds"]), float(data["psnr"]))
