"""Describe a data set: card.json for programs, README.md as the card that Hugging Face shows."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toonset import __version__
from toonset.apps.batch.records import ANGLES, UNKNOWN, SheetRecord
from toonset.dataset.bundle_files import PINHOLE
from toonset.errors import one_line

SCHEMA = "toonset-dataset/1"
BIN_DEG = 15  # bins are centred on its multiples: drawings of the front are in one bin
BAR = 40  # characters of the longest bar
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (10**6, "100K<n<1M"))
SPDX = (  # what Hugging Face knows of them, in small letters
    *("apache-2.0", "mit", "cc0-1.0", "cc-by-3.0", "cc-by-4.0", "cc-by-sa-3.0", "cc-by-sa-4.0"),
    *("cc-by-nc-4.0", "cc-by-nc-sa-4.0", "cc-by-nd-4.0", "cc-by-nc-nd-4.0", "unlicense"),
)


@dataclass
class Tally:
    """What is counted of sheets, one after another; grows with characters and licenses only."""

    sheets: Counter[str] = field(default_factory=Counter)  # by split, as all counters here
    views: Counter[str] = field(default_factory=Counter)
    characters: dict[str, set[str]] = field(default_factory=dict)
    labelled: int = 0
    verdicts: Counter[str] = field(default_factory=Counter)  # these by their own names
    view_verdicts: Counter[str] = field(default_factory=Counter)
    models: Counter[str] = field(default_factory=Counter)
    licenses: Counter[str] = field(default_factory=Counter)
    versions: Counter[str] = field(default_factory=Counter)
    yaw: Counter[int] = field(default_factory=Counter)
    elevation: Counter[int] = field(default_factory=Counter)

    def add(self, split: str, sheet: SheetRecord) -> None:
        """Count a sheet."""
        values = sheet.values
        self.sheets[split] += 1
        self.views[split] += len(sheet.views)
        self.characters.setdefault(split, set()).add(values["character"])
        self.labelled += bool(values["palette"])
        self.verdicts[values["verdict"]] += 1
        self.licenses[values["license"]] += 1
        self.versions[values["toonset"] or UNKNOWN] += 1
        for view in sheet.views:
            self.view_verdicts[view.values["view_verdict"]] += 1
            self.models[view.values["camera"]["model"]] += 1
            self.yaw[_bin(view.values["yaw_deg"])] += 1
            self.elevation[_bin(view.values["elevation_deg"])] += 1


def make_card(
    tally: Tally,
    kind: str,
    shares: Sequence[float],
    files: Mapping[str, Sequence[Mapping[str, Any]]],
) -> dict[str, Any]:
    """Return the content of card.json.

    Args:
        tally: of all sheets.
        kind: webdataset, parquet or folder.
        shares: of train, val and test, as they were asked for.
        files: of every split that has any.
    """
    splits = {
        split: {
            "sheets": tally.sheets[split],
            "views": tally.views[split],
            "characters": len(tally.characters[split]),
            "files": [dict(file) for file in found],
        }
        for split, found in files.items()
    }
    return {
        "schema": SCHEMA,
        "toonset": __version__,
        "format": kind,
        "sheets": tally.sheets.total(),
        "views": tally.views.total(),
        "characters": len(set[str]().union(*tally.characters.values())),
        "sheets_with_labels": tally.labelled,
        "shares": list(shares),
        "splits": splits,
        "verdicts": _sorted(tally.verdicts),
        "view_verdicts": _sorted(tally.view_verdicts),
        "camera_models": _sorted(tally.models),
        "licenses": _sorted(tally.licenses),
        "calibrated_with": _sorted(tally.versions),
        "yaw_deg": {str(at): tally.yaw[at] for at in range(-180 + BIN_DEG, 181, BIN_DEG)},
        "elevation_deg": {str(at): tally.elevation[at] for at in range(-90, 91, BIN_DEG)},
    }


def _bin(angle: float) -> int:
    """Return the middle of an angle's bin, degrees in (-180, 180]."""
    middle = BIN_DEG * round(angle / BIN_DEG)
    return 180 - (180 - middle) % 360


def _sorted(counts: Counter[str]) -> dict[str, int]:
    return dict(sorted(counts.items()))


# ---- the card for people -------------------------------------------------------------------------


def readme(card: Mapping[str, Any], example: str) -> str:
    """Return the content of README.md.

    Args:
        card: the content of card.json.
        example: name of a sheet.
    """
    parts = (
        *(_front(card), "# Character sheets with cameras", _summary(card)),
        *("## Counts", _splits(card), _counts("verdict", "sheets", card["verdicts"])),
        *(_counts("license", "sheets", card["licenses"]), "## Angles", _angles(card)),
        *("## Records", _records(card), "## Cameras", _CAMERAS),
        *("## Loading", "In the data set's folder:", _loading(card, example)),
    )
    return "\n\n".join(parts) + "\n"


def _front(card: Mapping[str, Any]) -> str:
    """Return the YAML that Hugging Face reads; foreign text never comes into it."""
    known = [name.lower() for name in card["licenses"]]
    one = known[0] if len(known) == 1 and known[0] in (*SPDX, UNKNOWN) else "other"
    size = next((name for most, name in SIZES if card["views"] < most), "n>1M")
    lines = [f"license: {one}", "task_categories:", "- image-to-3d", "size_categories:"]
    lines += [f"- {size}", "tags:", "- toonset", "- camera-pose", "- character-sheets"]
    lines += ["configs:", "- config_name: default", "  data_files:"]
    for split in card["splits"]:
        lines += [f"  - split: {split}", "    path:"]
        lines += [f'    - "{pattern}"' for pattern in _patterns(card, split)]
    return "\n".join(["---", *lines, "---"])


def _patterns(card: Mapping[str, Any], split: str) -> list[str]:
    """Return which files are those of a split."""
    if card["format"] == "webdataset":
        return [f"{split}-*.tar"]
    if card["format"] == "parquet":
        return [f"{split}-*.parquet"]
    maps = [f"{split}/*/labels/*.png"] if card["sheets_with_labels"] else []
    return [f"{split}/metadata.jsonl", f"{split}/*/images/*.png", *maps]


def _summary(card: Mapping[str, Any]) -> str:
    with_labels = card["sheets_with_labels"]
    maps = "all" if with_labels == card["sheets"] else str(with_labels)
    return (
        f"{_count(card['sheets'], 'hand-drawn character sheet')} of "
        f"{_count(card['characters'], 'character')}, {_count(card['views'], 'view')}: every view "
        "with its camera and how sure that is. "
        f"Palettes and label maps: {maps} of the sheets. Made with toonset {card['toonset']}; "
        "all figures of this page are in `card.json`."
    )


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _splits(card: Mapping[str, Any]) -> str:
    rows = [
        (split, *(str(found[name]) for name in ("sheets", "views", "characters")))
        for split, found in card["splits"].items()
    ]
    table = _table(("split", "sheets", "views", "characters"), rows)
    return f"{table}\n\nAll sheets of a character are in one split."


def _counts(name: str, what: str, counts: Mapping[str, int]) -> str:
    return _table((name, what), [(_cell(key), str(count)) for key, count in counts.items()])


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """Return foreign text as it can stand in a table of Markdown."""
    return re.sub(r"([\\`*_{}\[\]<>()#+!|~&])", r"\\\1", one_line(text))


def _angles(card: Mapping[str, Any]) -> str:
    parts = [f"Views by yaw and elevation, bins of {BIN_DEG} degrees around these values:"]
    for name in ("yaw_deg", "elevation_deg"):
        parts.append("\n".join(["```text", name, *_bars(card[name]), "```"]))
    return "\n\n".join(parts)


def _bars(counts: Mapping[str, int]) -> Iterator[str]:
    """Yield a line for each bin; a bin with anything in it has a bar."""
    most = max(counts.values(), default=0)
    for at, count in counts.items():
        bar = "#" * -(-BAR * count // max(most, 1))
        yield f"{at:>5} {bar} {count}".rstrip() if count else f"{at:>5}"


def _records(card: Mapping[str, Any]) -> str:
    parts = [_PLACES[card["format"]], "Values:", _VALUES]
    if card["format"] == "webdataset" and 0 < card["sheets_with_labels"] < card["sheets"]:
        parts.insert(1, _SOME_LABELS)
    return "\n\n".join(parts)


def _loading(card: Mapping[str, Any], example: str) -> str:
    split = next(iter(card["splits"]))
    files = card["splits"][split]["files"]
    first, last = files[0]["name"], files[-1]["name"]
    digits = [re.sub(r"\D", "", name) for name in (first, last)]
    shards = first if first == last else f"{split}-{{{digits[0]}..{digits[1]}}}.tar"
    return _LOADING[card["format"]].format(split=split, shards=shards, example=example)


_PLACES = {
    "webdataset": (
        "A sample is one view, its key is the sheet's name and the view's number. A sheet's views "
        "follow each other in one shard.\n\n"
        "- `png`: the drawing, RGBA, straight alpha\n"
        "- `labels.png`: which colour of the palette a pixel is, indexed PNG, 255 = none\n"
        "- `json`: the values"
    ),
    "parquet": (
        "A row is one view. A sheet's views follow each other in one file.\n\n"
        "- `image`: the drawing, RGBA, straight alpha\n"
        "- `labels`: which colour of the palette a pixel is, indexed PNG, 255 = none\n"
        "- the values, a column each"
    ),
    "folder": (
        "A folder is one sheet, and `metadata.jsonl` of a split has a line for every view with "
        "the values.\n\n"
        "- `images/`: the drawings, RGBA, straight alpha\n"
        "- `labels/`: which colour of the palette a pixel is, indexed PNG, 255 = none\n"
        "- `transforms.json`: cameras, as nerfstudio reads them\n"
        "- `calibration.json`: their covariances and alternatives\n"
        "- `palette.json`: the colours"
    ),
}
_SOME_LABELS = (
    "Some sheets have no labels. `datasets` wants the same files in every sample, and may refuse "
    "these shards; `toonset pack --to parquet` has no such limit."
)
_VALUES = f"""\
- `sheet`, `view`, `views`: the sheet's name, the view's number from 0, how many it has
- `character`, `license`, `source`: as the sheet's owner said; `{UNKNOWN}` where nobody did
- `verdict`, `reason`: on the sheet's cameras: ok, weak, ambiguous or failed
- `view_verdict`, `view_reason`: on this view's
- {", ".join(f"`{name}`" for name in ANGLES)}: of the camera
- {", ".join(f"`sigma_{name}`" for name in ANGLES)}: one standard deviation of each
- `p_flip`: probability that the view is seen from the opposite side
- `transform_matrix`, {", ".join(f"`{name}`" for name in PINHOLE)}: the camera as a pinhole
- `camera`: the exact camera
- `palette`: hex, share of the character's pixels and name of every colour; a label indexes it
- `toonset`: the version that found the cameras"""
_CAMERAS = """\
The world is right-handed, +Y up; the character faces +Z, and +X is on its left. Pixel (0.5, 0.5) is
the middle of the first pixel. Yaw 0 is the front, 90 the character's left side; elevation > 0 looks
down.

- `transform_matrix` is world from camera with OpenGL axes (x right, y up, z back), as nerfstudio
  has it. An orthographic view is a far pinhole there, at most `camera.pinhole_error_px` px off.
- `camera` has OpenCV axes (x right, y down, z forward). A point of the world is at (x, y, z) =
  `rotation` (point - `target`), and is drawn at
  u = `center[0]` + `scale` x / (1 + `k` z) and
  v = `center[1]` + `scale` `pixel_aspect` y / (1 + `k` z). With `k` = 0 it is orthographic."""
_LOADING = {
    "webdataset": """\
```python
import io

import numpy as np
import webdataset as wds
from PIL import Image


def labels(data):
    return np.array(Image.open(io.BytesIO(data)))


views = wds.WebDataset("{shards}", shardshuffle=False)
for view in views.decode(wds.handle_extension("labels.png", labels), "pilrgba"):
    print(view["json"]["sheet"], view["png"].size, view["json"]["yaw_deg"])
```

`datasets` reads the shards, too:
`load_dataset("webdataset", data_files="{split}-*.tar", split="train")`.""",
    "parquet": """\
```python
from datasets import load_dataset

for view in load_dataset("parquet", data_files="{split}-*.parquet", split="train"):
    print(view["sheet"], view["image"].size, view["yaw_deg"])
```

Pictures of `labels` are indexed: `numpy.array(view["labels"])` has the labels.""",
    "folder": """\
```python
import toonset as ts

bundle = ts.read_bundle("{split}/{example}")
for frame in bundle.scene.frames:
    print(frame.name, frame.rgba.shape, frame.camera.angles)
```

nerfstudio takes a sheet's folder, `datasets` all of a split:
`load_dataset("imagefolder", data_dir="{split}", split="train")`.""",
}


def encode_card(card: Mapping[str, Any], example: str) -> dict[str, bytes]:
    """Return the files of the card by name."""
    text = json.dumps(card, indent=2, allow_nan=False) + "\n"
    return {"card.json": text.encode(), "README.md": readme(card, example).encode()}
