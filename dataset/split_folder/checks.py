"""Check files that are read together, and split folders."""

from __future__ import annotations

from pathlib import Path
from statistics import median

from toonset.dataset.bundle.problem_log import Problem, ProblemLog
from toonset.dataset.bundle.transforms_read import member
from toonset.dataset.images.folder import picture_files
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.split_folder.places import IMAGES, OVERLAY, SPLIT_FILE
from toonset.dataset.split_folder.read import read_split
from toonset.dataset.split_folder.views import Split
from toonset.dataset.split_folder.write import read_records

OTHER_SCALE = 1.5  # times the usual height of a figure, or less than its inverse


def odd_files(split: Split) -> tuple[str, ...]:
    """Return a line, for people, about every file that is unlike the others or a copy of one."""
    return (*_copies(split), *_sheets_among_views(split), *_other_scales(split))


def _copies(split: Split) -> tuple[str, ...]:
    """Return a line for every file that is a copy of an earlier one; its views count twice."""
    first: dict[str, int] = {}
    notes = []
    for index, source in enumerate(split.sources):
        earlier = first.setdefault(source.sha256, index)
        if earlier != index:
            name = split.sources[earlier].name
            notes.append(f"{source.name} is a copy of {name}: is one of them another view?")
    return tuple(notes)


def _sheets_among_views(split: Split) -> tuple[str, ...]:
    counts = [split.source_of.count(index) for index in range(len(split.sources))]
    if len(counts) < 3 or median(counts) != 1:
        return ()
    return tuple(
        f"{source.name} shows {count} figures, the others one: is it a sheet of the same views?"
        for source, count in zip(split.sources, counts, strict=True)
        if count > 1
    )


def _other_scales(split: Split) -> tuple[str, ...]:
    """Return a line for every file whose figures are much higher or lower than most."""
    if len(split.sources) < 2:
        return ()
    heights = [view.figure_box[3] for view in split.views]
    usual = median(heights)
    lines = []
    for index, source in enumerate(split.sources):
        mine = [h for h, of in zip(heights, split.source_of, strict=True) if of == index]
        height = median(mine) if mine else usual
        if not usual / OTHER_SCALE <= height <= usual * OTHER_SCALE:
            lines.append(
                f"{source.name}: {height:g} px high, most views are {usual:g}: is it drawn at "
                "another scale?"
            )
    return tuple(lines)


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
