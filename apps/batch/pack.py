"""Write a finished batch as a data set."""

from __future__ import annotations

import hashlib
import itertools
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from toonset.apps.batch.progress import Result, Teller
from toonset.errors import OutputError, ToonsetError, UsageError, counted
from toonset.write import check_output, new_folder, write_bytes

if TYPE_CHECKING:
    from toonset.apps.batch.card import Tally
    from toonset.apps.batch.records import SheetRecord
    from toonset.apps.batch.shards import Shard
    from toonset.apps.batch.table import Table

Write = Callable[[Path, str, Iterator["SheetRecord"], int], list["Shard"]]
SPLITS = ("train", "val", "test")
CARD = "card.json"
WRITTEN = (
    *("README.md", CARD, *SPLITS),
    *(f"{split}-[0-9]*.{end}" for split in SPLITS for end in ("tar", "parquet")),
)


@dataclass(frozen=True)
class Packing:
    """How a batch is packed.

    Attributes:
        kind: webdataset, parquet or folder.
        verdicts: of the sheets that are taken.
        split: shares of train, val and test, as "80,10,10".
        shard_bytes: most of a shard.
    """

    kind: str
    verdicts: tuple[str, ...]
    split: str
    shard_bytes: int


def pack_batch(batch: Path, out: Path, how: Packing, *, force: bool, tell: Teller) -> Result:
    """Write the sheets of a batch that are done as one data set.

    Args:
        batch: its folder.
        out: folder to write.
        how: what of it, as what.
        force: replace what is there.
        tell: is told how it goes.

    Raises:
        ToonsetError: there is nothing to pack, or no place for it.
    """
    from toonset.apps.batch.shards import check_parquet

    shares = _shares(how.split)
    if how.kind == "parquet":
        check_parquet()
    _check_out(out, batch, force=force)
    with closing(_table(batch)) as table:
        wanted = Wanted(batch, table, how.verdicts, shares)
        chosen, tally = _choose(wanted, tell)
        with new_folder(out, force=force) as folder:
            card = _write(folder, wanted, how, chosen, tally, tell)
    splits = {name: card["splits"][name]["sheets"] for name in card["splits"]}
    told = ", ".join(f"{name} {count}" for name, count in splits.items())
    tell.say(f"{counted(card['sheets'], 'sheet')}, {counted(card['views'], 'view')}: {told}")
    for name, share in zip(SPLITS, shares, strict=True):
        if share and name not in splits:
            tell.say(f"{name} is empty: no character fell into its share of {share:g}")
    values = {name: card[name] for name in ("format", "sheets", "views", "characters")}
    return Result({"out": out, **values, "splits": splits}, str(out))


@dataclass(frozen=True)
class Wanted:
    """What is packed.

    Attributes:
        batch: folder of the batch.
        table: of it.
        verdicts: of sheets to take.
        shares: of train, val and test.
    """

    batch: Path
    table: Table
    verdicts: tuple[str, ...]
    shares: tuple[float, ...]

    def record(self, name: str, *, decode: bool) -> SheetRecord | None:
        """Return a sheet's record; None where it is not wanted, or not done."""
        from toonset.apps.batch.records import read_sheet

        row = self.table.row(name)
        if row is None or row.state != "done":
            return None
        with self._home(name) as home:
            return read_sheet(home, row, self.verdicts, decode=decode)

    @contextmanager
    def _home(self, name: str) -> Iterator[Path]:
        """Yield a sheet's folder; of a batch with a store a copy, for as long as it is read."""
        from toonset.apps.batch.dispatch import home_of
        from toonset.apps.batch.stages import BUNDLE, STAGES
        from toonset.apps.batch.storage import fetch

        if not (store := self.table.store):
            yield home_of(self.batch, name)
            return
        url = f"{store.rstrip('/')}/{name}"
        with TemporaryDirectory() as place:
            fetch(f"{url}/{BUNDLE}", Path(place), without=Path(STAGES["train"].writes).name)
            try:
                yield Path(place)
            except ToonsetError as error:
                raise type(error)(str(error).replace(place, url)) from error


@dataclass(frozen=True, order=True)
class Chosen:
    """A sheet that is packed.

    Attributes:
        name: of it.
        split: that it is in.
        digest: of its record, as it was checked.
    """

    name: str
    split: str
    digest: bytes


def split_of(character: str, shares: Sequence[float]) -> str:
    """Return the split of a character: where the hash of its name falls among the shares.

    Case and forms of Unicode make no difference, and no other character does.
    """
    folded = unicodedata.normalize("NFKC", character).casefold()
    number = int.from_bytes(hashlib.sha256(folded.encode()).digest()[:4], "big") / 2**32
    ends = [*itertools.accumulate(shares)]
    return next(name for name, end in zip(SPLITS, ends, strict=True) if number * ends[-1] < end)


def _shares(text: str) -> tuple[float, ...]:
    parts = [part.strip() for part in text.split(",")]
    is_number = all(re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", part) for part in parts)
    shares = tuple(float(part) for part in parts) if is_number else ()
    if len(shares) != len(SPLITS) or not sum(shares):
        raise UsageError(f"--split {text!r}: is not three shares TRAIN,VAL,TEST, as 80,10,10")
    return shares


def _table(batch: Path) -> Table:
    """Open the table of a batch."""
    from toonset.apps.batch.table import Table
    from toonset.apps.batch.table_file import TABLE, tables_in

    if TABLE not in (found := tables_in(batch)) and found:
        raise UsageError(f"{batch}: is in parts still; run `toonset batch --merge` on it first")
    return Table(batch / TABLE)


def _check_out(out: Path, batch: Path, *, force: bool) -> None:
    """Refuse, before any work, a place that must not be written.

    Many data sets have a folder "train": only a card says that one is ours.
    """
    check_output(out, [batch], WRITTEN, force=force)
    if out.is_dir() and any(out.iterdir()) and not (out / CARD).is_file():
        raise OutputError(
            f"{out}: has no {CARD}, so it is no data set of toonset, and --force does not replace "
            "it; choose another -o"
        )


def _choose(wanted: Wanted, tell: Teller) -> tuple[list[Chosen], Tally]:
    """Return the sheets to pack, by name, each read and checked to its last pixel."""
    from toonset.apps.batch.card import Tally

    states, chosen, tally = Counter[str](), list[Chosen](), Tally()
    for row in wanted.table.rows():
        sheet = wanted.record(row.name, decode=True)
        states["of another verdict" if row.state == "done" else row.state] += sheet is None
        if sheet is not None:
            split = split_of(sheet.values["character"], wanted.shares)
            tally.add(split, sheet)
            chosen.append(Chosen(sheet.name, split, sheet.digest))
            tell.progress(f"checking sheets {len(chosen)}")
    left = ", ".join(f"{count} {state}" for state, count in states.items() if count)
    if not chosen:
        raise ToonsetError(
            f"{wanted.batch}: has no sheet to pack ({left or 'none at all'}); run the batch first, "
            "or take other verdicts"
        )
    if left:
        tell.say(f"left out: {left}")
    return sorted(chosen), tally


def _write(
    folder: Path, wanted: Wanted, how: Packing, chosen: Sequence[Chosen], tally: Tally, tell: Teller
) -> dict[str, Any]:
    """Write all splits and the card."""
    from toonset.apps.batch.card import encode_card, make_card
    from toonset.apps.batch.shards import write_folders, write_parquet, write_webdataset

    writers: dict[str, Write] = {
        "webdataset": write_webdataset,
        "parquet": write_parquet,
        "folder": write_folders,
    }
    files = {}
    for split in SPLITS:
        names = [one for one in chosen if one.split == split]
        if names:
            shards = writers[how.kind](
                folder, split, _records(wanted, names, tell), how.shard_bytes
            )
            files[split] = [asdict(shard) for shard in shards]
    card = make_card(tally, how.kind, wanted.shares, files)
    example = next(one.name for one in chosen if one.split == next(iter(files)))
    for name, data in encode_card(card, example).items():
        write_bytes(folder / name, data)
    return card


def _records(wanted: Wanted, chosen: Sequence[Chosen], tell: Teller) -> Iterator[SheetRecord]:
    """Yield the records of sheets, which are as they were when they were checked."""
    for number, one in enumerate(chosen, 1):
        sheet = wanted.record(one.name, decode=False)
        if sheet is None or sheet.digest != one.digest:
            raise ToonsetError(
                f"{one.name}: has changed while it was packed; wait for the batch, and pack again"
            )
        tell.progress(f"packing {one.split} {number}/{len(chosen)}")
        yield sheet
