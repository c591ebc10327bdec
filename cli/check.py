"""`toonset info` and `check`: summarise a bundle, run or split folder; list its problems."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.common.output import Printer
from toonset.errors import BundleError, counted

if TYPE_CHECKING:
    from toonset.dataset.bundle.problem_log import Problem, ProblemLog


RUN, SPLIT, CAMERAS = "run", "split", "cameras"
MARKS = ((RUN, "config.json"), (RUN, "model.safetensors"), (SPLIT, "split.json"))
BAD = 2  # exit code, as of any other bad input
SHOWN_METRICS = ("psnr", "psnr_mask", "ssim")


def info(
    bundle: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A bundle, a run, a split folder, or any transforms.json."
        ),
    ] = Path("bundle"),
    *,
    printer: Printer,
) -> None:
    """Tell what is in a bundle: views and how sure they are, colours, runs, sizes, versions.

    Also of a run folder, a folder of `toonset split`, and cameras of other programs. Pictures are
    not looked into; `toonset check` does that.
    """
    from toonset.cli.common.info_text import bundle_text, run_text, split_text

    kind = kind_of(bundle)
    if kind == RUN:
        found = summarise_run(bundle)
        printer.result(found, run_text(found))
    elif kind == SPLIT:
        found = summarise_split(bundle)
        printer.result(found, split_text(found))
    else:
        found = _summarise_bundle(bundle)
        printer.result(found, bundle_text(found))


def _summarise_bundle(path: Path) -> dict[str, Any]:
    from toonset.dataset.bundle.summary import runs_of, summarise
    from toonset.errors import ToonsetError

    found = summarise(path) | {"runs": []}
    for run in runs_of(path if path.is_dir() else path.parent):
        try:
            found["runs"].append(summarise_run(run))
        except ToonsetError as error:
            found["damaged"].append(str(error))
    return found


def check(
    bundle: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A bundle, a run, a split folder, or any transforms.json."
        ),
    ] = Path("bundle"),
    *,
    printer: Printer,
) -> None:
    """Say everything that is wrong with a bundle: which file, what, and what to do.

    Reads every file whole, also what the next step would not need. Exit code 2 where there is a
    problem, 0 where there is none.
    """
    problems = _problems(bundle)
    width = max((len(problem.where) for problem in problems), default=0)
    lines = [f"{problem.where:{width}}  {problem.what}" for problem in problems]
    count = counted(len(problems), "problem") if problems else "no problem"
    if not printer.quiet:
        lines.append(f"{bundle}: {count}")
    found = [{"where": problem.where, "what": problem.what} for problem in problems]
    printer.result({"path": bundle, "problems": found}, "\n".join(lines))
    if problems:
        raise typer.Exit(BAD)


def _problems(path: Path) -> list[Problem]:
    from toonset.dataset.bundle.problem_log import ProblemLog

    kind = kind_of(path)
    if kind == RUN:
        log = ProblemLog(path)
        _check_run(log, path)
        return log.problems
    if kind == SPLIT:
        from toonset.dataset.split_folder.checks import split_problems

        return split_problems(path)
    from toonset.dataset.bundle.check import bundle_problems
    from toonset.dataset.bundle.summary import runs_of

    log = ProblemLog(path if path.is_dir() else path.parent)
    for run in runs_of(log.root):
        _check_run(log, run)
    return [*bundle_problems(path), *log.problems]


def _check_run(log: ProblemLog, run: Path) -> None:
    """Read a run as rendering would."""
    from toonset.json_file import read_json
    from toonset.nerf.run.folder import read_field

    name = "" if run == log.root else f"{run.name}/"
    log.attempt(name, read_field, run)
    log.attempt(f"{name}metrics.json", read_json, run / "metrics.json")


def kind_of(path: Path) -> str:
    """Return "cameras" (a bundle or any transforms.json), "run" or "split".

    Raises:
        BundleError: it is none of them.
    """
    from toonset.dataset.bundle.transforms_read import NAMES
    from toonset.dataset.images.folder import ENDINGS

    if not path.exists():
        raise BundleError(f"{path}: does not exist; name a bundle, a run or a split folder")
    if path.suffix.lower() in ENDINGS:
        raise BundleError(
            f"{path}: is a picture; name a folder that `toonset split` or `calibrate` has written"
        )
    if not path.is_dir():
        return CAMERAS
    if any((path / name).is_file() for name in NAMES):
        return CAMERAS
    kind = next((kind for kind, name in MARKS if (path / name).is_file()), None)
    if kind is None:
        raise BundleError(
            f"{path}: holds no transforms.json, split.json or config.json; name a folder that "
            "`toonset calibrate`, `split` or `train` has written (`toonset import` reads others)"
        )
    return kind


def summarise_run(folder: Path) -> dict[str, Any]:
    """Return what a run folder says of itself; the field is not loaded.

    Raises:
        BundleError: config.json or metrics.json cannot be read.
    """
    from toonset.dataset.bundle.summary import sizes
    from toonset.json_file import read_json

    config = _table(read_json(folder / "config.json"))
    metrics = _table(read_json(folder / "metrics.json"))
    field, scene = _table(config.get("field")), _table(config.get("scene"))
    verdict = _table(metrics.get("verdict"))
    return {
        "kind": "run",
        "path": str(folder),
        "steps": metrics.get("steps"),
        "stopped": metrics.get("stopped"),
        "fit": {k: v for k, v in _table(metrics.get("train")).items() if k in SHOWN_METRICS},
        "verdict": verdict.get("verdict"),
        "reasons": verdict.get("reasons", []),
        "views": scene.get("views"),
        "palette": field.get("palette"),
        "options": config.get("options"),
        "versions": config.get("versions"),
        "bytes": sizes(folder),
    }


def summarise_split(folder: Path) -> dict[str, Any]:
    """Return what split.json says, and which pictures came and went since.

    The pictures are not looked into.

    Raises:
        SheetError: split.json cannot be read.
    """
    from toonset.dataset.bundle.summary import sizes
    from toonset.dataset.images.folder import picture_files
    from toonset.dataset.split_folder.places import IMAGES
    from toonset.dataset.split_folder.write import read_records

    sheets, views = read_records(folder)
    place = folder / IMAGES
    there = [path.name for path in picture_files(place)[0]] if place.is_dir() else []
    known = [view.name for view in views]
    return {
        "kind": "split",
        "path": str(folder),
        "sheets": [
            {
                "name": sheet.name,
                "size_wh": list(sheet.size_wh),
                "warnings": list(sheet.warnings),
                "left_out": [{"kind": one.kind, "box": list(one.box)} for one in sheet.left_out],
            }
            for sheet in sheets
        ],
        "views": [view.model_dump(mode="json") for view in views],
        "gone": [name for name in known if name not in there],
        "new": [name for name in there if name not in known],
        "bytes": sizes(folder),
    }


def _table(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}
