"""Stamps beside the results of a sheet's stages: of what inputs, options and versions they are."""

from __future__ import annotations

import json
from pathlib import Path

from toonset.apps.batch.rows import StageRow
from toonset.apps.batch.stages import STAGES, dependents


def stages_there(home: Path) -> set[str]:
    """Return the stages whose stamps and results lie in a sheet's folder."""
    return {stage for stage in STAGES if _is_there(home, stage)}


def _is_there(home: Path, stage: str) -> bool:
    result = home / STAGES[stage].writes / STAGES[stage].mark
    return stamp_of(home, stage).is_file() and result.exists()


def read_stamp(home: Path, stage: str, key: str) -> StageRow | None:
    """Return the row of a stage that is done with a key; None where it is not."""
    if not _is_there(home, stage):
        return None
    try:
        row = StageRow(**json.loads(stamp_of(home, stage).read_bytes()))
    except (OSError, ValueError, TypeError):  # cut short, or of an older toonset
        return None
    return row if row.key == key else None


def stamp_of(home: Path, stage: str) -> Path:
    """Return the place of a stage's stamp."""
    return home / f"{stage}.json"


def remove_stamps(home: Path, first: str) -> None:
    """Remove what says that a stage, and what is made of its result, is done."""
    for stage in (first, *dependents(first)):
        stamp_of(home, stage).unlink(missing_ok=True)
