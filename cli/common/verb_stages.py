"""Run verbs as the stages of a batch: parse the words after them, call them, keep their results."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import typer

from toonset.apps.batch.stages import STAGES, Verbs, usual_words
from toonset.apps.batch.storage import is_url
from toonset.cli.common.flags import Given, arguments_of, command_of, each_of
from toonset.cli.common.help import Verb
from toonset.cli.common.output import Keeper
from toonset.cli.common.refusals import refusal
from toonset.cli.common.verbs import function_of
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import ToonsetError, UsageError, one_line
from toonset.options import is_described
from toonset.palette.options import PaletteOptions

OWN = ("out", "force", "printer", "threads", "preview_every", "strict")  # what a batch sets
OWN_FLAGS = (
    *("--out", "-o", "--force", "--json", "--quiet", "-q", "--verbose", "-v"),
    *("--threads", "--preview-every", "--strict"),
)
PARTS = {  # of toonset, that stages import
    "calibrate": "calib",
    "palette": "palette",
    "train": "nerf",
    "render": "nerf",
    "view": "nerf",
    "mesh": "nerf",
    "export": "dataset",
}


def options_of(stage: str, words: Sequence[str], where: str) -> dict[str, Any]:
    """Return every option of a verb by its name, for words as they are typed after it.

    Args:
        stage: the verb.
        words: options only: what it reads and writes is the batch's.
        where: who says so, for messages.

    Raises:
        UsageError: the verb does not take them, or a batch sets them itself.
    """
    return each_of(_parse(stage, words, where))


def check(stage: str, words: Sequence[str], where: str) -> None:
    """Refuse words that a verb does not take, and values that it refuses before it reads anything.

    Raises:
        UsageError: beginning with `where`.
    """
    values = _parse(stage, words, where)
    try:
        if words:
            _check_values(values)
    except ToonsetError as error:
        raise UsageError(f"{where}: {one_line(error)}") from error


def run(
    stage: str, words: Sequence[str], sheets: Sequence[str], home: Path
) -> tuple[int, dict[str, Any]]:
    """Run a verb on a sheet.

    Args:
        stage: the verb.
        words: of its command line.
        sheets: the drawings.
        home: the sheet's folder.

    Returns:
        its exit code and its result, as `--json` prints it.

    Raises:
        Exception: what the verb raises.
    """
    verb = STAGES[stage]
    values = _parse(stage, words, stage)
    reads: Any = home / verb.reads if verb.reads else [Path(sheet) for sheet in sheets]
    values[verb.argument] = [reads] if verb.argument == "inputs" else reads
    values |= {"out": home / verb.writes} if verb.has_out else {}
    keeper = Keeper()
    call, code = function_of(stage), 0
    own = {"force": True, "threads": 1, "printer": keeper}
    taken = inspect.signature(call).parameters
    values |= {name: value for name, value in own.items() if name in taken}
    try:
        call(**values)
    except typer.Exit as leaving:
        code = leaving.exit_code
    return code, keeper.kept


def load(stages: Sequence[str]) -> None:
    """Import what the stages would, so that processes forked from this one need not."""
    for part in dict.fromkeys(PARTS[stage] for stage in stages):
        package = importlib.import_module(f"toonset.{part}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    applications = ("toonset.apps.web.viewer.page",) if "view" in stages else ()
    for name in (*applications, "PIL.Image", "trimesh.exchange.load", "skimage.measure"):
        importlib.import_module(name)
    importlib.import_module("PIL.Image").init()


VERBS = Verbs(options_of, check, run, load, refusal)


def _parse(stage: str, words: Sequence[str], where: str) -> dict[str, Any]:
    """Return what to call a verb with, by parameter."""
    command, typed = _command(stage), [*usual_words(STAGES[stage], words), *words]
    try:
        context = command.make_context(f"toonset {stage}", typed, allow_extra_args=True)
        values = arguments_of(context)
    except Exception as error:
        if (flag := getattr(error, "option_name", "")) in OWN_FLAGS:
            raise UsageError(f"{where}: {flag} is set by toonset batch; leave it out") from error
        said = refusal(error)
        if said is None:
            raise
        raise UsageError(f"{where}: {said}") from error
    if context.args:
        raise UsageError(f"{where}: {stage} reads the sheet's own; options only are taken here")
    return values


def _check_values(values: Mapping[str, Any]) -> None:
    """Refuse what a verb refuses before it reads anything."""
    from toonset.dataset.split_folder.view_labels import parse_labels
    from toonset.palette.choice import rule_of

    for given in values.values():
        options = given.over(given.kind()) if isinstance(given, Given) else given
        if isinstance(options, PaletteOptions):
            rule_of(replace(options, keep="") if is_url(options.keep) else options)
        elif is_described(type(options)) and hasattr(options, "check"):
            options.check()
        if isinstance(options, SheetOptions) and options.labels:
            parse_labels(options.labels, options.labels.count(",") + 1)


@cache
def _command(stage: str) -> Any:
    """Return a command that takes the options of a verb which are not the batch's."""
    own = typer.Typer(add_completion=False, rich_markup_mode=None)
    without = (STAGES[stage].argument, *OWN)
    own.command(stage, cls=Verb, add_help_option=False)(command_of(function_of(stage), without))
    return typer.main.get_command(own)
