"""Imports run one way, and every place that lists the stage folders lists all of them."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import toonset as ts

ROOT = Path(__file__).resolve().parents[1]
# A stage imports only stages with a lower number: calib and nerf never see each other.
LAYERS = {"palette": 1, "dataset": 2, "calib": 3, "nerf": 3, "apps": 4, "cli": 5}
OUTSIDE = ("lab", "tests", "examples")  # of the wheel: no stage imports them


# Within a stage a room imports only rooms on a lower floor; "@" marks a file of the stage's own
# folder. Rooms of one floor do not see each other, so there is no circle.
FLOORS: dict[str, tuple[str, ...]] = {
    "palette": (
        "@colors @options",
        "@color_names",
        "@names",
        "@palette",
        "pixels",
        "@corrections @named @plain_sheets formats paints",
        "@printed @shaded",
        "@sheet_palette @swatch_image",
        "@stepped",
        "@choice",
        "@extract",
        "@corrected @coverage @recolor",
    ),
    "dataset": (
        "images split.figures",
        "mesh split.touching",
        "bundle mannequin",
        "silhouettes synthetic",
        "split",
        "@bundle_files @stored_views exporters split_folder",
        "@label_drawings @packed_views importers",
        "@view_dataset",
    ),
    "calib": (
        "@options",
        "evidence outline",
        "@mannequin_points fit",
        "@result search",
        "@known flaws verdict",
        "@from_landmarks @pipeline without_body",
        "@captions @find_cameras @hints @write_bundle",
        "@calibrate",
    ),
    "nerf": (
        "@options kernels",
        "sections",
        "hull",
        "look",
        "prepare",
        "fields",
        "render surface train",
        "score",
        "run",
        "@training layered_views",
        "@leave_one_out",
    ),
    "apps": ("batch web.editor web.viewer",),
    "cli": ("common", "@"),  # a verb imports no other verb
}
# What an application imports of the stages beside names of `import toonset`, by its room: this list
# is only to become shorter. Of the bottom layer (`toonset/*.py`) it may import everything.
INNER: dict[str, tuple[str, ...]] = {
    "batch": (
        "dataset.bundle_files",  # bytes and records of a bundle's files
        "dataset.images.folder",  # which files are pictures
        "dataset.mesh.obj",  # which files a mesh names
        "palette.names",
    ),
    "web.editor": (
        "calib.without_body.cues",  # kept from one fit to the next
        "dataset.bundle_files",
        "dataset.label_drawings",
        "dataset.split_folder.corrected",
        "dataset.split_folder.load",  # the type of a cut sheet
        "nerf.surface.decimate",
        "palette.names",
    ),
    "web.viewer": ("nerf.layered_views.build",),
}
MOST_ROOMS, MOST_OF_APPS = 41, 5  # folders of all stages but applications, and of those
MOST_OFFERED = 16  # modules of a room that other rooms import
MOST_FILES = 16  # in a folder of tests or lab
MOST_LINES = 400  # of a source file


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


def room_of(module: str) -> str:
    """Return the room of `toonset.STAGE.ROOM.FILE`, "@FILE" for a file outside of all rooms."""
    inside = module.split(".")[2:]
    return ".".join(inside[:-1]) or f"@{inside[-1]}"


def floor_of(stage: str, room: str) -> int:
    """Return the number of the floor that a room is listed on."""
    for number, floor in enumerate(FLOORS[stage]):
        if room in floor.split() or (room[0] == "@" and "@" in floor.split()):
            return number
    raise AssertionError(f"{stage}: {room} is on no floor of this file's table")


def imports_within(stage: str) -> Iterator[tuple[str, str]]:
    """Yield every (importing, imported) pair of a stage's modules, as dotted names."""
    files = [path for path in (ROOT / stage).rglob("*.py") if path.name != "__init__.py"]
    places = {path: dotted(path) for path in files}
    for path, module in places.items():
        for name in imported_names(path) & set(places.values()):
            yield module, name


def dotted(path: Path) -> str:
    """Return the name under which a source file is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts if parts[0] == "toonset" else ("toonset", *parts))


def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("stage", LAYERS)
def test_stage_imports_only_lower_layers(stage: str) -> None:
    for path in (ROOT / stage).rglob("*.py"):
        for other in imported_stages(path) - {stage}:
            assert LAYERS[other] < LAYERS[stage], f"{path.relative_to(ROOT)} imports {other}"


@pytest.mark.parametrize("stage", LAYERS)
def test_room_imports_only_lower_floors(stage: str) -> None:
    wrong = [
        f"{one} imports {other}"
        for one, other in imports_within(stage)
        if (here := room_of(one)) != (there := room_of(other))
        and floor_of(stage, there) >= floor_of(stage, here)
    ]
    assert not wrong


@pytest.mark.parametrize("stage", LAYERS)
def test_table_of_floors_lists_what_is_there(stage: str) -> None:
    listed = {room for floor in FLOORS[stage] for room in floor.split()} - {"@"}
    files = [path for path in (ROOT / stage).rglob("*.py") if path.name != "__init__.py"]
    there = {room_of(dotted(path)) for path in files}
    assert listed <= there
    assert all(floor_of(stage, room) >= 0 for room in there)


def test_no_circle_within_a_room() -> None:
    for folder in folders():
        imports = imports_among(folder)
        for module, imported in imports.items():
            seen, left = set(), set(imported)
            while left:
                name = left.pop()
                assert name != module, f"{module} imports itself by way of others"
                seen.add(name)
                left |= imports[name] - seen


def imports_among(folder: Path) -> dict[str, set[str]]:
    """Return which modules of one folder import which of the others."""
    modules = modules_of(folder)
    return {name: imported_names(path) & set(modules) for name, path in modules.items()}


def folders() -> list[Path]:
    """Return every folder of the product that holds Python files."""
    stages = [path.parent for stage in LAYERS for path in (ROOT / stage).rglob("__init__.py")]
    return [ROOT / "toonset", *stages]


def modules_of(folder: Path) -> dict[str, Path]:
    """Return the modules that lie in one folder, by their dotted names."""
    return {dotted(path): path for path in folder.glob("*.py") if path.name != "__init__.py"}


def test_rooms_offer_few_modules_to_others() -> None:
    rooms = {folder: modules_of(folder) for folder in folders()}
    names = {path: imported_names(path) for room in rooms.values() for path in room.values()}
    for folder, modules in rooms.items():
        others = (found for path, found in names.items() if path.parent != folder)
        offered = set(modules) & set[str]().union(*others)
        assert len(offered) <= MOST_OFFERED, f"{folder.relative_to(ROOT)}: {sorted(offered)}"
    applications = {one for one in rooms if ROOT / "apps" in {one, *one.parents}}
    assert len(applications) <= MOST_OF_APPS
    assert len(rooms) - len(applications) <= MOST_ROOMS


def test_source_files_are_short() -> None:
    for path in (path for folder in folders() for path in folder.glob("*.py")):
        lines = len(path.read_text(encoding="utf-8").splitlines())
        assert lines <= MOST_LINES, f"{path.relative_to(ROOT)}: {lines} lines"


def test_folders_of_tests_and_lab_hold_few_files() -> None:
    for folder in {path.parent for top in ("lab", "tests") for path in (ROOT / top).rglob("*.py")}:
        assert len(list(folder.glob("*.py"))) <= MOST_FILES, folder.relative_to(ROOT)


def test_bottom_layer_imports_no_stage() -> None:
    for path in (ROOT / "toonset").glob("*.py"):
        own_doors = ("__init__.py", "__main__.py")  # the public interface, the command
        assert path.name in own_doors or not imported_stages(path), path.name


def inner_modules(path: Path) -> set[str]:
    """Return the modules of stages that a source file imports, without "toonset." before them."""
    stages = {f"toonset.{stage}" for stage in LAYERS}
    modules = {dotted(file) for stage in LAYERS for file in (ROOT / stage).rglob("*.py")}
    found = set()
    for name in imported_names(path):
        if ".".join(name.split(".")[:2]) in stages:
            of = next((one for one in (name, name.rpartition(".")[0]) if one in modules), name)
            found.add(of.removeprefix("toonset."))
    return found


def roundabout_imports(path: Path) -> set[str]:
    """Return how a source file gets at stages other than by an import: see `imported_names`."""
    nodes = [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))]
    stages = {f"{package}.{stage}" for package in ("toonset", "ts") for stage in LAYERS}
    looked_up = {ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute)} & stages
    called = {node.id for node in nodes if isinstance(node, ast.Name)} & {"__import__"}
    named = {name for name in imported_names(path) if not name.startswith("importlib.metadata")}
    return looked_up | called | ({name.split(".")[0] for name in named} & {"importlib", "pkgutil"})


@pytest.mark.parametrize("app", INNER)
def test_application_sees_the_public_interface(app: str) -> None:
    found = set[str]()
    for path in (ROOT / "apps" / app.replace(".", "/")).glob("*.py"):
        names = imported_names(path)
        assert not roundabout_imports(path), path.relative_to(ROOT)
        public = {name for name in names if name.count(".") == 1 and name.startswith("toonset.")}
        known = {*dir(ts), *(file.stem for file in (ROOT / "toonset").glob("*.py")), *LAYERS}
        assert {name.split(".")[1] for name in public} <= known, path.relative_to(ROOT)
        found |= {name for name in inner_modules(path) if not name.startswith(f"apps.{app}.")}
    assert found - {f"apps.{app}"} == set(INNER[app])


def test_every_application_is_listed() -> None:
    files = [*(ROOT / "apps").rglob("*.py")]
    assert not [path for path in files if path.name == "__init__.py" and imported_names(path)]
    rooms = {path.parent for path in files if path.name != "__init__.py"}
    assert {".".join(room.relative_to(ROOT / "apps").parts) for room in rooms} == set(INNER)


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
