"""`toonset check`: everything that is wrong with a bundle, a run or a split folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.folder_kind import RUN, SPLIT, kind_of
from toonset.cli.output import JsonFlag, Printer, QuietFlag

if TYPE_CHECKING:
    from toonset.dataset.bundle.problem_log import Problem, ProblemLog

BAD = 2  # exit code, as of any other bad input


def check(
    bundle: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="A bundle, a run, a split folder, or any transforms.json."
        ),
    ] = Path("bundle"),
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Say everything that is wrong with a bundle: which file, what, and what to do.

    Reads every file whole, also what the next step would not need. Exit code 2 where there is a
    problem, 0 where there is none.
    """
    problems = _problems(bundle)
    width = max((len(problem.where) for problem in problems), default=0)
    lines = [f"{problem.where:{width}}  {problem.what}" for problem in problems]
    count = "no problem" if not problems else f"{len(problems)} problem" + "s" * (len(lines) > 1)
    if not quiet:
        lines.append(f"{bundle}: {count}")
    found = [{"where": problem.where, "what": problem.what} for problem in problems]
    Printer(as_json, quiet).result({"path": bundle, "problems": found}, "\n".join(lines))
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
    from toonset.nerf.run.manifest import check_manifest

    name = "" if run == log.root else f"{run.name}/"
    log.attempt(name, read_field, run)
    log.attempt(f"{name}manifest.json", check_manifest, run)
    log.attempt(f"{name}metrics.json", read_json, run / "metrics.json")
