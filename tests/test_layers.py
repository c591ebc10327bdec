"""Imports run one way, and every place that lists the stage folders lists all of them."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
# A stage imports only stages with a lower number: calib and nerf never see each other.
LAYERS = {"palette": 1, "dataset": 2, "calib": 3, "nerf": 3, "cli": 4}
OUTSIDE = ("bench", "tests", "examples")  # of the wheel: no stage imports them


def imported_names(path: Path) -> set[str]:
    """Return every dotted name that one source file imports, `from` imports with their members."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            names |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names


def imported_stages(path: Path) -> set[str]:
    """Return the stages that one source file imports."""
    parts = (name.split(".") for name in imported_names(path))
    return {part[1] for part in parts if part[0] == "toonset" and len(part) > 1} & set(LAYERS)


def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("stage", LAYERS)
def test_stage_imports_only_lower_layers(stage: str) -> None:
    for path in (ROOT / stage).rglob("*.py"):
        for other in imported_stages(path) - {stage}:
            assert LAYERS[other] < LAYERS[stage], f"{path.relative_to(ROOT)} imports {other}"


def test_bottom_layer_imports_no_stage() -> None:
    for path in (ROOT / "toonset").glob("*.py"):
        assert path.name == "__main__.py" or not imported_stages(path), path.name


@pytest.mark.parametrize("folder", ["toonset", *LAYERS])
def test_imports_are_absolute_and_go_through_toonset(folder: str) -> None:
    for path in (ROOT / folder).rglob("*.py"):
        for name in imported_names(path):
            assert name.split(".")[0] not in {"", *LAYERS, *OUTSIDE}, (
                f"{path.relative_to(ROOT)}: {name}"
            )


@pytest.mark.parametrize("stage", LAYERS)
def test_link_for_type_checkers(stage: str) -> None:
    link = ROOT / "toonset" / stage
    assert link.is_symlink()
    assert link.readlink() == Path("..", stage)


def test_pyproject_lists_every_package() -> None:
    setuptools = pyproject()["tool"]["setuptools"]
    inits = (init for stage in LAYERS for init in (ROOT / stage).rglob("__init__.py"))
    found = {"toonset." + ".".join(init.parent.relative_to(ROOT).parts) for init in inits}
    assert set(setuptools["packages"]) == found | {"toonset"}
    assert setuptools["package-dir"] == {f"toonset.{stage}": stage for stage in LAYERS}


def test_every_source_folder_is_a_package() -> None:
    for stage in LAYERS:
        for path in (ROOT / stage).rglob("*.py"):
            assert (path.parent / "__init__.py").is_file(), path.relative_to(ROOT)


def test_tools_know_every_stage() -> None:
    tools = pyproject()["tool"]
    assert set(LAYERS) <= set(tools["ruff"]["lint"]["flake8-tidy-imports"]["banned-api"])
    assert {f"toonset/{stage}" for stage in LAYERS} <= set(tools["pyright"]["include"])
    assert set(LAYERS) <= set(tools["coverage"]["run"]["source"])
