"""List the sheets of a batch: files, folders, patterns and URLs, or manifests that say more."""

from __future__ import annotations

import fnmatch
import glob
import os
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from toonset.apps.batch.given import Given, clean_name, stem_of
from toonset.apps.batch.manifest import MANIFESTS, OPTIONS, manifest_sheets
from toonset.apps.batch.stages import STAGES, Entry, Verbs, as_words, files_among, value_of
from toonset.apps.batch.storage import file_name, find, is_url
from toonset.errors import SheetError, UsageError, as_text, printable

LONGEST_NAME = 100  # bytes: a folder of toonset's own adds some, 255 is the most
SOME = 5  # names that a line says
WILD = re.compile(r"[*?\[]")
SPLIT = "split.json"  # in a folder that `toonset split` wrote


def list_sheets(
    places: Sequence[str],
    words: Mapping[str, Sequence[str]],
    verbs: Verbs,
    root: Path | None = None,
    out: Path | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> list[Entry]:
    """Return the sheets of places as a person names them, each checked, by name.

    Args:
        places: pictures, folders of them, patterns, URLs, manifests.
        words: of every stage's command line, for all sheets; those of a manifest follow.
        verbs: that the stages are.
        root: the folder that a manifest's paths are relative to; None: the manifest's own.
        out: the batch's folder: what a pattern finds in there is no sheet.
        say: is told what a folder holds that is not taken.

    Raises:
        ToonsetError: nothing is there, a manifest says what cannot be, two have one name.
    """
    given = [one for place in places for one in _given(place, root, out, say)]
    given = _without_twins(given, say)
    if not given:
        raise SheetError(f"{', '.join(map(printable, places))}: no sheets there; name pictures")
    here = Given("", Path.cwd(), False, "", {})
    common = {stage: _absolute(stage, said, (), here, verbs) for stage, said in words.items()}
    entries = [_entry(one, common, verbs) for one in given]
    _check_names(entries, given)
    return sorted(entries, key=lambda entry: entry.name)


def choose(
    entries: Sequence[Entry], only: Sequence[str] = (), part: tuple[int, int] = (0, 1)
) -> frozenset[str]:
    """Return the names of the sheets that are to run.

    Args:
        entries: all of them.
        only: names, or patterns of names; none: all.
        part: which one, from 0, of how many.

    Raises:
        UsageError: nothing is called so.
    """
    mine = frozenset(entry.name for entry in entries[part[0] :: part[1]])
    return mine & named({entry.name for entry in entries}, only, "--only") if only else mine


def named(names: Iterable[str], patterns: Sequence[str], option: str) -> frozenset[str]:
    """Return those of names that patterns match.

    Raises:
        UsageError: nothing is called as one of them.
    """
    found = set[str]()
    for pattern in patterns:
        if not (some := {name for name in names if fnmatch.fnmatchcase(name, pattern)}):
            raise UsageError(f"{option} {pattern!r}: no sheet is called so")
        found |= some
    return frozenset(found)


def _given(
    place: str, root: Path | None, out: Path | None, say: Callable[[str], None]
) -> Iterator[Given]:
    """Yield the sheets of one place."""
    from toonset.dataset.images.folder import ENDINGS, WORKING, picture_files
    from toonset.read import check_there

    path, here = Path(place), Path.cwd()
    if is_url(place):
        is_web = place.lower().startswith(("http://", "https://"))  # a "?" there is no wildcard
        found = find(place) if "*" in place or (WILD.search(place) and not is_web) else [place]
        if found != [place]:
            found = [url for url in found if Path(url).suffix.lower() in ENDINGS]
        for url in found:
            yield Given(url, here, False, clean_name(stem_of(file_name(url))), {"sheet": url})
        return
    if path.suffix.lower() in MANIFESTS and not path.is_dir():
        yield from manifest_sheets(path, root)
        return
    if WILD.search(place) and not path.exists():
        base = Path(WILD.split(place)[0] + "x").parent  # up to the first wild part
        files = [Path(name) for name in sorted(glob.glob(place, recursive=True))]
        meant = (*ENDINGS, *(end for end in WORKING if place.lower().endswith(end)))
        files = [file for file in files if file.is_dir() or file.suffix.lower() in meant]
        files = [file for file in files if out is None or not _is_within(file, out)]
        parents = {parent for file in files for parent in file.parents}
        files = [file for file in files if file not in parents]  # what is in it is taken
    else:
        check_there([path], "picture", SheetError)
        base, files = path.parent, [path]
        if path.is_dir() and not (path / SPLIT).is_file():
            pictures, others = picture_files(path)
            base, files = path, list(pictures)
            _say_left(path, others, say)
    for file in files:
        inside = file.relative_to(base)
        name = clean_name(
            "-".join(inside.with_name(inside.name if file.is_dir() else inside.stem).parts)
        )
        yield Given(str(file), here, False, name, {"sheet": str(file)})


def _without_twins(given: Sequence[Given], say: Callable[[str], None]) -> list[Given]:
    """Return the sheets less the copies of one drawing: of hero.png and hero.jpg the first.

    Twins lie in one folder, are called alike but for their endings, and are named in no manifest.
    """
    from toonset.dataset.images.folder import ENDINGS

    best: dict[tuple[Path, str], Given] = {}
    ranks = {ending: rank for rank, ending in enumerate(ENDINGS)}
    for one in given:
        if (key := _twin_key(one)) is not None:
            rank = ranks.get(Path(one.where).suffix.lower(), len(ranks))
            other = best.setdefault(key, one)
            if rank < ranks.get(Path(other.where).suffix.lower(), len(ranks)):
                best[key] = one
    kept = []
    for one in given:
        key = _twin_key(one)
        first = one if key is None else best[key]
        if first is one or Path(first.where).suffix == Path(one.where).suffix:  # named twice
            kept.append(one)
        else:
            beside = f"{Path(first.where).name} beside it is the same sheet"
            say(f"{one.where}: left out, {beside} by its name; rename one if it is not")
    return kept


def _twin_key(one: Given) -> tuple[Path, str] | None:
    """Return what twins share: folder and name without ending; None for folders and URLs."""
    path = Path(one.where)
    if one.inside or is_url(one.where) or path.is_dir():
        return None
    return Path(os.path.abspath(path)).parent, path.stem


def _say_left(folder: Path, others: Sequence[str], say: Callable[[str], None]) -> None:
    """Say what of a folder is not taken though it might be meant."""
    from toonset.dataset.images.folder import ENDINGS, left_out_lines

    manifests = [name for name in others if name.lower().endswith(MANIFESTS)]
    for name in sorted(manifests):
        say(f"{folder / name}: is not used; to use a manifest, name it in place of its folder")
    rest = [name for name in others if name not in manifests and not (folder / name).is_dir()]
    for line in left_out_lines(rest):
        say(f"{folder}: {line}")
    pictures = [file for file in folder.glob("*/*") if file.suffix.lower() in ENDINGS]
    below = sorted({file.parent.name for file in pictures if file.parent.name[0] != "."})
    if below:
        said = f"{folder}: folders in it are not read ({some_of(below)})"
        say(f"{said}; '{folder}/**/*.png' takes theirs, too")


def some_of(names: Sequence[str]) -> str:
    """Return the first of many names, for a line."""
    return ", ".join(names[:SOME]) + ", ..." * (len(names) > SOME)


def _is_within(file: Path, folder: Path) -> bool:
    return Path(os.path.abspath(file)).is_relative_to(os.path.abspath(folder))


def _entry(given: Given, common: Mapping[str, tuple[str, ...]], verbs: Verbs) -> Entry:
    """Return a sheet with its paths found and its options checked."""
    _check_name(given)
    values, words = given.values, {}
    sheets = values["sheet"] if isinstance(values["sheet"], list) else [values["sheet"]]
    for stage in STAGES:
        own = [*as_words(values.get(f"{stage}{OPTIONS}", ""), given.where)]
        if stage == "calibrate":
            own += [f"--mesh={values['mesh']}"] if "mesh" in values else []
            own += [f"--views={values['views']}"] if "views" in values else []
        usual = common.get(stage, ())
        said = (*usual, *_absolute(stage, own, usual, given, verbs))
        if said:
            words[stage] = said
    return Entry(
        given.name,
        tuple(_place(sheet, given) for sheet in sheets),
        words,
        values.get("character", given.name),
        values.get("license", ""),
        values.get("source", ""),
    )


def _check_name(given: Given) -> None:
    """Refuse a name that could mean something to a shell, a page or another system."""
    name = given.name
    if not name or clean_name(name) != name:
        raise SheetError(
            f"{given.where}: {printable(name)!r} is no name for a sheet; take letters, digits, "
            "'_' and '-', a letter or digit first"
        )
    if len(name.encode()) > LONGEST_NAME:
        raise SheetError(f"{given.where}: its name is longer than {LONGEST_NAME} bytes; shorten it")


def _check_names(entries: Sequence[Entry], given: Sequence[Given]) -> None:
    """Refuse two sheets whose folders would be one, on some file systems at least."""
    seen: dict[str, tuple[str, str]] = {}
    for entry, one in zip(entries, given, strict=True):
        folded = unicodedata.normalize("NFKC", entry.name).casefold()
        if folded in seen:
            name, where = seen[folded]
            said = "two sheets are called" if name == entry.name else "differs by case only from"
            first = f"{entry.name!r} " if name != entry.name else ""
            raise SheetError(
                f"{one.where}: {first}{said} {name!r}, the other is {where}; name one differently"
            )
        seen[folded] = entry.name, one.where


def _place(place: str, given: Given) -> str:
    """Return the absolute path of what a sheet names, which is there, or its URL."""
    from toonset.read import check_there

    if is_url(place):
        _check_url(place, given)
        return place
    path = _within(place, given)
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise SheetError(f"{as_text(given.where)}: its name is no UTF-8; rename it") from error
    try:
        check_there([path], "picture", SheetError)
    except SheetError as error:
        raise SheetError(f"{given.where}: {error}" if given.inside else str(error)) from error
    return str(path)


def _check_url(place: str, given: Given) -> None:
    """Refuse a manifest's URL that is a path of this machine."""
    if given.inside and place.lower().startswith(("file:", "local:")):
        raise SheetError(f"{given.where}: {printable(place)!r} is a file here; name its path")


def _within(place: str, given: Given) -> Path:
    """Return an absolute path; one that leads out of its manifest's root is refused."""
    path = Path(os.path.abspath(given.root / place))
    if given.inside and not path.resolve().is_relative_to(given.root.resolve()):
        raise SheetError(
            f"{given.where}: {printable(place)!r} lies outside of {given.root}; move it there, or "
            "widen --root"
        )
    return path


def _absolute(
    stage: str, words: Sequence[str], common: Sequence[str], given: Given, verbs: Verbs
) -> tuple[str, ...]:
    """Return a stage's words, checked behind the common ones; files among them as absolute."""
    from toonset.read import check_there

    if not words:
        return ()
    where = given.where or f"--with {stage}"
    options = verbs.options(stage, [*common, *words], where)
    files = {*files_among(options, words, given.root).values()}
    absolute = []
    for word in words:
        value = value_of(word)
        if is_url(value):
            _check_url(value, given)
        elif value in files:
            path = _within(value, given)
            try:
                check_there([path], "file", SheetError)
            except SheetError as error:
                raise SheetError(f"{where}: {error}") from error
            word = word.removesuffix(value) + str(path)
        absolute.append(word)
    return tuple(absolute)
