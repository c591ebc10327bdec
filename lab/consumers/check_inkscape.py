"""Check that Inkscape shows the SVGs of `render --format svg` as toonset does, by its classes.

    apt-get install inkscape xvfb
    toonset render RUN --turntable 4 --format svg -o vectors
    xvfb-run -a python lab/consumers/check_inkscape.py vectors

Every SVG is opened (a word of Inkscape's is a failure), drawn, and compared with the PNG beside it;
a file without one is only opened. Every group must be found by its name; a class that is given
another colour must be drawn in it. Without a display Inkscape warns of a GtkRecentManager whatever
it opens: hence xvfb. Measured with Inkscape 1.2.2, 4 views each of two characters: no warning, FLIP
0.013 to 0.019 at 299 px (the example) and 0.009 to 0.014 at 515 px; all groups found; 40 paints,
and a view without lines, the same.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from toonset.nerf.score.flip import load_flip

MOST_FLIP = 0.02
OTHER = (255, 0, 255)  # no character's colour


def inkscape(*words: str | Path) -> str:
    """Return what Inkscape prints; a warning of it ends the check."""
    line = ["inkscape", *map(str, words)]
    done = subprocess.run(line, check=True, capture_output=True, text=True, timeout=300)
    assert not done.stderr.strip(), done.stderr
    return done.stdout


def drawn(source: Path, place: Path) -> np.ndarray:
    """Return a file as Inkscape draws it, over white, sRGB in [0, 1]."""
    target = place / f"{source.stem}_drawn.png"
    inkscape(source, "--export-type=png", f"--export-filename={target}")
    return over_white(target)


def over_white(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        rgba = np.array(image.convert("RGBA")) / 255
    return np.asarray(rgba[..., :3] * rgba[..., 3:] + 1 - rgba[..., 3:])


def check(source: Path, place: Path) -> None:
    text = source.read_text(encoding="utf-8")
    groups = set(re.findall(r'<g id="([^"]+)"', text))
    found = {line.split(",")[0] for line in inkscape("--query-all", source).splitlines()}
    assert groups <= found, groups - found
    own, said = drawn(source, place), []
    if (picture := source.with_suffix(".png")).is_file():
        flip = load_flip()
        assert not isinstance(flip, str), flip
        off = float(flip(over_white(picture), own).mean())
        said.append(f"FLIP {off:.4f}")
        assert off <= MOST_FLIP, f"{source}: FLIP {off:.4f}"
    classes: list[tuple[str, str]] = re.findall(r"\.([\w-]+)\{fill:(#\w+)\}", text)
    reached = 0
    for name, color in classes:
        changed = place / f"{source.stem}_changed.svg"
        new = "#{:02x}{:02x}{:02x}".format(*OTHER)
        changed.write_text(text.replace(f".{name}{{fill:{color}}}", f".{name}{{fill:{new}}}"))
        moved = np.abs(drawn(changed, place) - own).max(axis=2) > 0.02
        reached += bool(moved.any())
    said += [f"{len(groups)} groups", f"{reached} of {len(classes)} classes seen to change"]
    said += [f"{text.count('<path')} paths", f"{source.stat().st_size / 1e3:.0f} kB"]
    print(f"{source}: {', '.join(said)}")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for svg in sorted(Path(sys.argv[1]).glob("*.svg")):
            check(svg, Path(folder))
