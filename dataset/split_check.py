"""Everything that is wrong with a split folder, in one go."""

from __future__ import annotations

from pathlib import Path

from toonset.dataset.picture import load_rgba
from toonset.dataset.picture_folder import picture_files
from toonset.dataset.problem_log import Problem, ProblemLog
from toonset.dataset.scene_read import member
from toonset.dataset.split_files import IMAGES, OVERLAY, SPLIT_FILE, read_records
from toonset.dataset.split_read import read_split


def split_problems(folder: Path) -> list[Problem]:
    """Return every problem of a split folder; without one, `calibrate` and `palette` read it."""
    log = ProblemLog(folder)
    log.attempt(SPLIT_FILE, read_records, folder)
    paths = picture_files(folder / IMAGES)[0] if (folder / IMAGES).is_dir() else ()
    for name in (f"{IMAGES}/{path.name}" for path in paths):
        _check_picture(log, name)
    if not log.problems:  # what only shows when all is read together
        log.attempt(SPLIT_FILE, read_split, folder)
    _check_picture(log, OVERLAY)
    return log.problems


def _check_picture(log: ProblemLog, name: str) -> None:
    found = log.attempt(name, member, log.root, name)
    if found is not None:
        log.attempt(name, load_rgba, found)
