"""Say what the stages of a batch are: verbs of toonset, their command lines, what they write.

A stage's key is one hash of all that its result depends on: the same key means the same result.
What a verb's words mean, and what it does, only the command line knows: it hands in `Verbs`.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from toonset.errors import UsageError, did_you_mean
from toonset.options import Body

PACKAGES = (  # whose versions results depend on
    *("toonset", "numpy", "scipy", "opencv-contrib-python-headless", "torch", "kornia", "Pillow"),
    *("trimesh", "scikit-image", "pycolmap", "xatlas"),
)
BUNDLE = "bundle"
RUN = f"{BUNDLE}/run"
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
    timed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verbs:
    """The verbs of the command line, as a batch needs them.

    Attributes:
        options: returns every option of a stage by its name, defaults included, for words as they
            are typed after the verb; words and where they were said, for messages.
        check: refuses words of a stage that the verb refuses before it reads anything.
        run: runs a stage for words, sheets and the sheet's folder; returns its exit code and its
            result, as `--json` prints it.
        load: imports what stages would, so that processes forked from this one need not.
        refusal: returns the line that tells a person of an error; None: it is a bug.
    """

    options: Callable[[str, Sequence[str], str], dict[str, Any]]
    check: Callable[[str, Sequence[str], str], None]
    run: Callable[[str, Sequence[str], Sequence[str], Path], tuple[int, dict[str, Any]]]
    load: Callable[[Sequence[str]], None]
    refusal: Callable[[Exception], str | None]


TURNTABLE: dict[tuple[str, ...], tuple[str, ...]] = {
    ("--turntable", "--cameras"): ("--turntable", "36")
}
_LIST = (
    Stage("calibrate", "", "sheets", "", BUNDLE, "transforms.json"),
    Stage(*("palette", "calibrate", "inputs", BUNDLE, BUNDLE, "palette.json"), has_out=False),
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


def usual_words(verb: Stage, words: Sequence[str]) -> list[str]:
    """Return what a verb is told where words do not say so."""
    said = {word.split("=")[0] for word in words}
    return [word for flags, usual in verb.usual.items() if not said & {*flags} for word in usual]


def check_options(entries: Iterable[Entry], stages: Sequence[str], verbs: Verbs) -> None:
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
            verbs.check(stage, words, f"{entry.name}: {stage}")


def value_of(word: str) -> str:
    """Return what a word of a command line says: of --option=value the value."""
    return word.partition("=")[2] if word.startswith("--") else word


def files_among(options: Mapping[str, Any], words: Sequence[str], root: Path) -> dict[str, str]:
    """Return the files and URLs among a verb's options, as typed, by the option's text.

    Args:
        options: what `Verbs.options` returned.
        words: that it was given.
        root: what they are relative to.
    """
    typed = {str(Path(value)): value for value in map(value_of, words) if value}
    found = {}
    for name, value in options.items():
        for one in value if isinstance(value, list | tuple) else [value]:
            text, is_path = str(one), isinstance(one, Path)
            if is_path and not (name == "mesh" and text == Body.NONE.value):
                found[text] = typed.get(text, text)
            elif name in FILE_OR_COLORS and isinstance(one, str) and (root / one).is_file():
                found[text] = one
    return found


def line_of(stage: str, words: Sequence[str], sheets: Sequence[str], home: Path) -> str:
    """Return the command line that does what `run` does, for people."""
    verb = STAGES[stage]
    reads = [str(home / verb.reads)] if verb.reads else sheets
    out = ["-o", str(home / verb.writes)] if verb.has_out else []
    return shlex.join(["toonset", stage, *reads, *usual_words(verb, words), *words, *out])


def as_words(text: str, where: str) -> tuple[str, ...]:
    """Return words as a shell would read them.

    Raises:
        UsageError: a quote is not closed.
    """
    try:
        return tuple(shlex.split(text))
    except ValueError as error:
        raise UsageError(f"{where}: {text!r}: {error}; close the quote") from error


def keys_of(
    entry: Entry, stages: Sequence[str], hash_of: Callable[[str], str], verbs: Verbs
) -> dict[str, str]:
    """Return the key of every stage: of inputs, all options, versions and the stage before.

    Args:
        entry: the sheet.
        stages: in order.
        hash_of: returns the hash of a file's or folder's content.
        verbs: that the stages are.

    Raises:
        UsageError: a stage lacks an option that it needs.
    """
    keys: dict[str, str] = {}
    for stage in stages:
        earlier = STAGES[stage].after
        content = {
            "stage": stage,
            "from": keys[earlier] if earlier else [_file(one, hash_of) for one in entry.sheets],
            "options": _options(stage, entry, hash_of, verbs),
            "versions": _versions(),
        }
        keys[stage] = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return keys


def _options(
    stage: str, entry: Entry, hash_of: Callable[[str], str], verbs: Verbs
) -> dict[str, Any]:
    words = entry.words.get(stage, ())
    options = verbs.options(stage, words, f"{entry.name}: {stage}")
    files = files_among(options, words, Path("/"))

    def plain(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        if isinstance(value, str | Path) and str(value) in files:
            return _file(files[str(value)], hash_of)
        return value.value if isinstance(value, Enum) else str(value)

    return {name: plain(value) for name, value in options.items()}


def _file(place: str, hash_of: Callable[[str], str]) -> list[str]:
    """Return a file's name, which bundles record, and its content's hash."""
    from toonset.apps.batch.storage import file_name

    return [file_name(place), hash_of(place)]


@cache
def _versions() -> dict[str, str]:
    found = {}
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):  # xatlas is not on every machine
            found[name] = version(name)
    return found
