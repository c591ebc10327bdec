"""Say what the stages of a batch are: verbs of toonset, their command lines, what they write.

A stage's key is one hash of all that its result depends on: the same key means the same result.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import inspect
import json
import pkgutil
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import typer

from toonset.cli.common.body import is_no_body
from toonset.cli.common.flags import Given, arguments_of, command_of, each_of
from toonset.cli.common.help import Verb
from toonset.cli.common.output import Keeper
from toonset.cli.common.refusals import refusal
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import ToonsetError, UsageError, one_line
from toonset.options import is_described
from toonset.palette.options import PaletteOptions

PACKAGES = (  # whose versions results depend on
    *("toonset", "numpy", "scipy", "opencv-contrib-python-headless", "torch", "kornia", "Pillow"),
    *("trimesh", "scikit-image", "pycolmap", "xatlas"),
)
BUNDLE = "bundle"
RUN = f"{BUNDLE}/run"
OWN = ("out", "force", "printer", "threads", "preview_every", "strict")  # what a batch sets
OWN_FLAGS = (
    *("--out", "-o", "--force", "--json", "--quiet", "-q", "--verbose", "-v"),
    *("--threads", "--preview-every", "--strict"),
)
FILE_OR_COLORS = ("colors", "keep", "palette", "variants")


@dataclass(frozen=True)
class Entry:
    """One sheet, and what is known of it.

    Attributes:
        name: of its folder and in the data set: letters, digits, "_" and "-".
        sheets: what `toonset calibrate` takes: absolute paths, or URLs.
        words: of a stage's command line, by stage; paths in them are absolute.
        character: whom it shows; the name where nobody says.
        license: of the drawing.
        source: where it is from.
    """

    name: str
    sheets: tuple[str, ...]
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    character: str = ""
    license: str = ""
    source: str = ""


@dataclass(frozen=True)
class Stage:
    """One verb on a sheet's way.

    Attributes:
        name: of the verb.
        after: the stage whose result it takes; "" for the first.
        argument: its parameter for what it reads.
        reads: that, in the sheet's folder; "": the sheets.
        writes: file or folder in the sheet's folder.
        mark: in it, what is there once it has written.
        has_out: whether it is told where to write.
        usual: what it is told where no other words say so, by the options that would.
        imports: the part of toonset to import before sheets come.
        timed: files of it that hold seconds, and differ each time.
    """

    name: str
    after: str
    argument: str
    reads: str
    writes: str
    mark: str = ""
    has_out: bool = True
    usual: Mapping[tuple[str, ...], tuple[str, ...]] = field(default_factory=dict)
    imports: str = "nerf"
    timed: tuple[str, ...] = ()


TURNTABLE: dict[tuple[str, ...], tuple[str, ...]] = {
    ("--turntable", "--cameras"): ("--turntable", "36")
}
_LIST = (
    Stage("calibrate", "", "sheets", "", BUNDLE, "transforms.json", imports="calib"),
    Stage(
        *("palette", "calibrate", "inputs", BUNDLE, BUNDLE, "palette.json"),
        has_out=False,
        imports="palette",
    ),
    Stage(
        *("train", "palette", "bundle", BUNDLE, RUN, "metrics.json"),
        timed=("metrics.json", "history.csv"),
    ),
    Stage("render", "train", "run", RUN, "turntable", usual=TURNTABLE),
    Stage("view", "train", "folder", RUN, "character.html"),
    Stage("mesh", "train", "run", RUN, "character.glb"),
    Stage(
        *("export", "calibrate", "bundle", BUNDLE, "export"),
        usual={("--body",): ("--body", "none")},  # a run may be there or not: another stage's
        imports="dataset",
    ),
)
STAGES: Mapping[str, Stage] = {stage.name: stage for stage in _LIST}
RANKS = {name: rank for rank, name in enumerate(STAGES)}


@cache
def dependents(stage: str) -> tuple[str, ...]:
    """Return the stages that are made of a stage's result, in order."""
    found = {stage}
    for name, verb in STAGES.items():
        found |= {name} if verb.after in found else set()
    return tuple(name for name in STAGES if name in found - {stage})


def in_order(names: Sequence[str]) -> tuple[str, ...]:
    """Return stages in the order in which they run.

    Raises:
        UsageError: one is unknown, or takes what none of the others makes.
    """
    from toonset.errors import did_you_mean

    if not names:
        raise UsageError(f"--stages: names no stage; known are {', '.join(STAGES)}")
    for name in names:
        if name not in STAGES:
            near = did_you_mean(name, STAGES)
            raise UsageError(
                f"--stages: {name!r} is none of {', '.join(STAGES)}" + (f"; {near}" if near else "")
            )
    for name in names:
        if (after := STAGES[name].after) and after not in names:
            raise UsageError(f"--stages: {name} needs {after}; add it")
    return tuple(sorted(set(names), key=RANKS.__getitem__))


def parse(stage: str, words: Sequence[str], where: str) -> dict[str, Any]:
    """Return a verb's options for words as they are typed after it, defaults included.

    Args:
        stage: the verb.
        words: options only: what it reads and writes is the batch's.
        where: who says so, for messages.

    Raises:
        UsageError: the verb does not take them, or a batch sets them itself.
    """
    command, typed = _command(stage), [*_usual(STAGES[stage], words), *words]
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


def _usual(verb: Stage, words: Sequence[str]) -> list[str]:
    said = {word.split("=")[0] for word in words}
    return [word for flags, usual in verb.usual.items() if not said & {*flags} for word in usual]


def check_options(entries: Iterable[Entry], stages: Sequence[str]) -> None:
    """Refuse sheets whose stages lack an option that they need, or have values that cannot be.

    Raises:
        UsageError: naming the first.
    """
    seen = set()
    for entry in entries:
        for stage in stages:
            words = entry.words.get(stage, ())
            if (stage, words) in seen:
                continue
            seen.add((stage, words))
            where = f"{entry.name}: {stage}"
            values = parse(stage, words, where)
            try:
                if words:
                    _check_values(values)
            except ToonsetError as error:
                raise UsageError(f"{where}: {one_line(error)}") from error


def _check_values(values: Mapping[str, Any]) -> None:
    """Refuse what a verb refuses before it reads anything."""
    from toonset.cli.common.storage import is_url
    from toonset.dataset.split_folder.view_labels import parse_labels
    from toonset.palette.extract import rule_of

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
    own.command(stage, cls=Verb, add_help_option=False)(command_of(_verb(stage), without))
    return typer.main.get_command(own)


def _verb(stage: str) -> Any:
    return getattr(importlib.import_module(f"toonset.cli.{stage}"), stage)


def value_of(word: str) -> str:
    """Return what a word of a command line says: of --option=value the value."""
    return word.partition("=")[2] if word.startswith("--") else word


def files_among(values: Mapping[str, Any], words: Sequence[str], root: Path) -> dict[str, str]:
    """Return the files and URLs among a verb's arguments, as typed, by the argument's text.

    Args:
        values: what `parse` returned.
        words: that it was given.
        root: what they are relative to.
    """
    typed = {str(Path(value)): value for value in map(value_of, words) if value}
    found = {}
    for name, value in each_of(values).items():
        for one in value if isinstance(value, list | tuple) else [value]:
            text, is_path = str(one), isinstance(one, Path)
            if is_path and not (name == "mesh" and is_no_body(one)):
                found[text] = typed.get(text, text)
            elif name in FILE_OR_COLORS and isinstance(one, str) and (root / one).is_file():
                found[text] = one
    return found


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
    values = parse(stage, words, stage)
    reads: Any = home / verb.reads if verb.reads else [Path(sheet) for sheet in sheets]
    values[verb.argument] = [reads] if verb.argument == "inputs" else reads
    values |= {"out": home / verb.writes} if verb.has_out else {}
    keeper = Keeper()
    call, code = _verb(stage), 0
    own = {"force": True, "threads": 1, "printer": keeper}
    taken = inspect.signature(call).parameters
    values |= {name: value for name, value in own.items() if name in taken}
    try:
        call(**values)
    except typer.Exit as leaving:
        code = leaving.exit_code
    return code, keeper.kept


def line_of(stage: str, words: Sequence[str], sheets: Sequence[str], home: Path) -> str:
    """Return the command line that does what `run` does, for people."""
    verb = STAGES[stage]
    reads = [str(home / verb.reads)] if verb.reads else sheets
    out = ["-o", str(home / verb.writes)] if verb.has_out else []
    return shlex.join(["toonset", stage, *reads, *_usual(verb, words), *words, *out])


def import_parts(stages: Sequence[str]) -> None:
    """Import what the stages would, so that processes forked from this one need not."""
    for part in dict.fromkeys(STAGES[name].imports for name in stages):
        package = importlib.import_module(f"toonset.{part}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for name in ("PIL.Image", "trimesh.exchange.load", "skimage.measure"):
        importlib.import_module(name)
    importlib.import_module("PIL.Image").init()


def as_words(text: str, where: str) -> tuple[str, ...]:
    """Return words as a shell would read them.

    Raises:
        UsageError: a quote is not closed.
    """
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise UsageError(f"{where}: {text!r}: {error}; close the quote") from error


def keys_of(entry: Entry, stages: Sequence[str], hash_of: Callable[[str], str]) -> dict[str, str]:
    """Return the key of every stage: of inputs, all options, versions and the stage before.

    Args:
        entry: the sheet.
        stages: in order.
        hash_of: returns the hash of a file's or folder's content.

    Raises:
        UsageError: a stage lacks an option that it needs.
    """
    keys: dict[str, str] = {}
    for stage in stages:
        earlier = STAGES[stage].after
        content = {
            "stage": stage,
            "from": keys[earlier] if earlier else [_file(one, hash_of) for one in entry.sheets],
            "options": _options(stage, entry, hash_of),
            "versions": _versions(),
        }
        keys[stage] = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return keys


def _options(stage: str, entry: Entry, hash_of: Callable[[str], str]) -> dict[str, Any]:
    words = entry.words.get(stage, ())
    values = parse(stage, words, f"{entry.name}: {stage}")
    files = files_among(values, words, Path("/"))

    def plain(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        if isinstance(value, str | Path) and str(value) in files:
            return _file(files[str(value)], hash_of)
        return value.value if isinstance(value, Enum) else str(value)

    return {name: plain(value) for name, value in each_of(values).items()}


def _file(place: str, hash_of: Callable[[str], str]) -> list[str]:
    """Return a file's name, which bundles record, and its content's hash."""
    from toonset.cli.common.storage import file_name

    return [file_name(place), hash_of(place)]


@cache
def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):  # xatlas is not on every machine
            found[name] = version(name)
    return found
