"""Build sdist and wheel, check both, and install the wheel in an environment outside of the tree.

    python wheel.py FOLDER    dist/ has the sdist and the wheel that was built of it; env/ has it
                              installed, beside the packages of the environment that runs this

Nothing is downloaded. The tree is not touched: its tracked files are copied first.
"""

import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "toonset/apps/batch/page/",
    "toonset/apps/web/editor/page/",
    "toonset/apps/web/viewer/page/",
)
NEEDED = ("toonset/py.typed", *PAGES)


def run(*words: str | Path, cwd: Path) -> None:
    """Run a module of this environment, or end with its exit code."""
    done = subprocess.run([sys.executable, "-P", "-m", *map(str, words)], cwd=cwd, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def copy_of_tree(place: Path) -> Path:
    """Return a folder with the tracked files as they are now; links stay links."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in filter(None, listed.stdout.decode().split("\0")):
        source, copy = ROOT / name, place / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        if source.is_symlink():
            copy.symlink_to(source.readlink())
        elif source.is_file():
            copy.write_bytes(source.read_bytes())
    return place


def contents(wheel: Path) -> dict[str, int]:
    """Return what is in a wheel: checksums by name."""
    with ZipFile(wheel) as archive:
        return {entry.filename: entry.CRC for entry in archive.infolist()}


def check_contents(wheel: Path, of_tree: Path) -> None:
    """Refuse a wheel that differs from the tree's own, lacks a data file, or has more packages."""
    names = contents(wheel)
    assert names == contents(of_tree), "the wheel of the sdist is not the wheel of the tree"
    for needed in NEEDED:
        have = [name for name in names if name.startswith(needed)]
        tracked = [path for path in (ROOT / needed.removeprefix("toonset/")).glob("*")]
        assert len(have) == max(1, len(tracked)), f"{needed}: {len(have)} files, {len(tracked)}"
    rooms = {name.split("/")[0] for name in names}
    assert rooms == {"toonset", f"{wheel.name.split('-py3')[0]}.dist-info"}, rooms


def install(wheel: Path, place: Path) -> None:
    """Install a wheel, and lay this environment's packages, without its toonset, beside it."""
    venv.create(place, symlinks=True)
    python = place / "bin" / "python"
    pip = ("uv", "pip", "install", "--quiet", "--offline", "--no-deps", "--python", python)
    run(*pip, wheel, cwd=place)
    site = next(place.glob("lib/python*/site-packages"))
    (site / "locked.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    command = [python, "-c", "import toonset; print(toonset.__file__)"]
    found = subprocess.run(command, cwd=place, capture_output=True, text=True, check=True).stdout
    assert Path(found.strip()) == site / "toonset" / "__init__.py", found


def main(place: Path) -> None:
    """Do all of it."""
    source, dist, tree = copy_of_tree(place / "source"), place / "dist", place / "tree"
    build = ("build", "--no-isolation", "--outdir")
    run(*build, dist, ".", cwd=source)
    (wheel,), (sdist,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    run(*build, tree, "--wheel", ".", cwd=source)
    check_contents(wheel, tree / wheel.name)
    run("twine", "check", "--strict", sdist, wheel, cwd=place)
    run("check_wheel_contents", wheel, cwd=place)
    install(wheel, place / "env")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
