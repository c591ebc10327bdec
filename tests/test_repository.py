"""What must hold for the repository as a whole, whatever the code does."""

import ast
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import toonset

ROOT = Path(__file__).resolve().parents[1]
LARGEST_BYTES = 300_000
LOCKS = ("requirements.lock", "bootstrap.lock")

# Spelled in pieces, so that this file passes its own test.
REGISTRY = re.compile(
    "|".join(
        (
            r"pypi" r"\.org",
            r"python" r"hosted",
            r"npm" r"js\.",
            r"conda" r"\.anaconda",
            r"registry" r"\.yarn",
            r"--(extra-)?index" r"-url",
            r"--find" r"-links",
        )
    ),
    re.IGNORECASE,
)
MACHINE_PATH = re.compile(
    r"(?<![\w.])/(?:ho" r"me|ro" r"ot|Us" r"ers|wo" r"rk|mnt|srv)/\w|\b[A-Z]:\\\\?Us" r"ers"
)
BANNED_IMPORTS = {"pickle", "cPickle", "dill", "marshal", "shelve"}
BANNED_CALLS = {"eval", "exec", "torch.load", "yaml.load", "cv2.imread", "cv2.imwrite", "os.system"}
SAFE_ARGUMENT = "weights_only=True"  # torch.load then reads tensors and nothing else
BANNED_ARGUMENTS = {("shell", True), ("allow_pickle", True), ("weights_only", False)}


def tracked_files() -> list[Path]:
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout: the list of tracked files is unknown")
    listing = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-z"], check=True, capture_output=True
    ).stdout.decode()
    return [path for name in listing.split("\0") if name and (path := ROOT / name).is_file()]


def tracked_texts() -> Iterator[tuple[Path, str]]:
    for path in tracked_files():
        data = path.read_bytes()
        if b"\0" not in data:
            yield path.relative_to(ROOT), data.decode("utf-8")


def tracked_trees() -> Iterator[tuple[Path, ast.Module]]:
    for path, text in tracked_texts():
        if path.suffix == ".py":
            yield path, ast.parse(text, str(path))


def test_no_large_file() -> None:
    sizes = {path: path.stat().st_size for path in tracked_files()}
    large = {str(p): n for p, n in sizes.items() if n > LARGEST_BYTES and p.name not in LOCKS}
    assert not large


@pytest.mark.parametrize("pattern", [REGISTRY, MACHINE_PATH], ids=["registry", "machine path"])
def test_no_place_that_only_one_machine_knows(pattern: re.Pattern[str]) -> None:
    found = {str(path): hit[0] for path, text in tracked_texts() if (hit := pattern.search(text))}
    assert not found


def test_python_files_compile() -> None:
    for path, tree in tracked_trees():
        compile(tree, str(path), "exec")


def test_nothing_that_runs_foreign_data() -> None:
    found = [f"{path}: {hit}" for path, tree in tracked_trees() for hit in dangers(tree)]
    assert not found


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from pickle import loads",
        "torch.load(f)",
        "eval('1')",
        "cv2.imread(f)",
        "yaml.load(f)",
        "subprocess.run(c, shell=True)",
        "np.load(f, allow_pickle=True)",
    ],
)
def test_dangers_are_seen(source: str) -> None:
    assert list(dangers(ast.parse(source)))


@pytest.mark.parametrize(
    "source",
    [
        "model.eval()",
        "np.load(f)",
        "torch.load(f, weights_only=True)",
        "safetensors.torch.load_file(f)",
    ],
)
def test_harmless_calls_pass(source: str) -> None:
    assert not list(dangers(ast.parse(source)))


def dangers(tree: ast.Module) -> Iterator[str]:
    """Yield each import, call or argument that could execute data or misread a picture."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ({alias.name for alias in node.names} & BANNED_IMPORTS)
        elif isinstance(node, ast.ImportFrom):
            yield from ({node.module or ""} & BANNED_IMPORTS)
        elif isinstance(node, ast.Call):
            if SAFE_ARGUMENT not in map(ast.unparse, node.keywords):
                yield from ({ast.unparse(node.func)} & BANNED_CALLS)
            yield from (
                f"{word.arg}={word.value.value}"
                for word in node.keywords
                if isinstance(word.value, ast.Constant)
                and (word.arg, word.value.value) in BANNED_ARGUMENTS
            )


def test_changelog_names_this_version() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d[^\]]*)\]", changelog, re.MULTILINE)
    assert newest is not None
    assert newest[1] == toonset.__version__


def test_licence_is_the_declared_one() -> None:
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["license"] == "MIT"


def locked(name: str) -> dict[str, list[tuple[Requirement, int]]]:
    """Return package -> its (pin, number of hashes); a package has one pin per Python range."""
    text = re.sub(r"^\s*#.*\n", "", (ROOT / name).read_text(encoding="utf-8"), flags=re.MULTILINE)
    pins: dict[str, list[tuple[Requirement, int]]] = {}
    for entry in re.split(r"\n(?=\S)", text.replace("\\\n", "").strip()):
        requirement = Requirement(entry.split("--hash")[0])
        hashes = len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", entry))
        pins.setdefault(canonicalize_name(requirement.name), []).append((requirement, hashes))
    return pins


@pytest.mark.parametrize("name", LOCKS)
def test_lock_pins_one_version_with_hashes_and_no_address(name: str) -> None:
    assert "://" not in (ROOT / name).read_text(encoding="utf-8")
    for pins in locked(name).values():
        for requirement, hashes in pins:
            assert re.fullmatch(r"==[^,*]+", str(requirement.specifier)), requirement
            assert hashes > 0, requirement


def test_lock_answers_every_declared_dependency() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    groups = declared["dependency-groups"].values()
    names = [*declared["project"]["dependencies"], *(name for group in groups for name in group)]
    pins = locked("requirements.lock")
    for wanted in map(Requirement, names):
        assert canonicalize_name(wanted.name) in pins, f"{wanted}: lock again, see CONTRIBUTING.md"
        for pin, _ in pins[canonicalize_name(wanted.name)]:
            version = str(pin.specifier).removeprefix("==")
            assert wanted.specifier.contains(version), f"{wanted} is locked as {pin}"


def test_both_locks_build_with_the_same_setuptools() -> None:
    pins = [str(locked(name)["setuptools"][0][0]) for name in LOCKS]
    assert pins[0] == pins[1]
