"""Find the named numbers of rooms: upper-case names of modules whose value holds a number.

A name is used where a function loads it. What is made of it at import, beside other names, is fixed
then: defaults of arguments, classes, decorators.
"""

from __future__ import annotations

import ast
import dis
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

import toonset

ROOT = Path(toonset.__file__).parent.parent
STAGES = ("palette", "dataset", "calib", "nerf", "cli")
SPLIT_ROOMS = ("dataset/split", "dataset/split/figures", "dataset/split/touching")
PALETTE_ROOMS = ("palette", "palette/paints", "palette/pixels", "palette/formats")

Place = tuple[str, int]  # file and line


@dataclass(frozen=True)
class Named:
    """A number with a name.

    Attributes:
        module: that defines it.
        name: in upper case.
        source: of its value.
        line: of the definition.
    """

    module: str
    name: str
    source: str
    line: int

    @property
    def room(self) -> str:
        """Return the folder that it lies in."""
        return "/".join(self.module.split(".")[1:-1]) or "toonset"


@dataclass(frozen=True)
class Use:
    """Where a name is bound to a number, and what happens to it there.

    Attributes:
        module: the number's own, or one that imports it.
        name: there.
        made: names whose values are made of it at import, in order.
        fixed: lines that keep its value at import otherwise.
        places: lines of functions that load it.
    """

    module: str
    name: str
    made: tuple[tuple[str, str], ...]
    fixed: tuple[int, ...]
    places: frozenset[Place]


@dataclass(frozen=True, eq=False)
class Source:
    """A module as it is written."""

    name: str
    path: Path
    tree: ast.Module
    code: CodeType


def read_sources() -> dict[str, Source]:
    """Return all modules of the product by their names."""
    found = {}
    for stage in (*STAGES, "toonset"):
        for path in sorted((ROOT / stage).glob("*.py" if stage == "toonset" else "**/*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            words = [part for part in parts if part not in ("__init__", "toonset")]
            name, live = ".".join(["toonset", *words]), ROOT / "toonset" / Path(*parts)
            live = path if stage == "toonset" else live.with_suffix(".py")
            text = path.read_text(encoding="utf-8")
            found[name] = Source(name, live, ast.parse(text), compile(text, str(live), "exec"))
    return found


def named_numbers(sources: dict[str, Source], rooms: Sequence[str] = ()) -> list[Named]:
    """Return the named numbers of rooms, in order; without rooms those of the whole product."""
    found = []
    for source in sources.values():
        for name, value, line in _assigned(source.tree):
            if name.isupper() and _holds_number(value):
                found.append(Named(source.name, name, ast.unparse(value), line))
    return [one for one in found if not rooms or one.room in rooms]


def uses_of(number: Named, sources: dict[str, Source]) -> list[Use]:
    """Return where a number is bound, its own module first."""
    bound = [(number.module, number.name)]
    for module, name in bound:  # grows
        for source in sources.values():
            for node in source.tree.body:
                if isinstance(node, ast.ImportFrom) and node.module == module:
                    names = [own.asname or own.name for own in node.names if own.name == name]
                    bound += [(source.name, own) for own in names]
    return [_use(sources[module], name) for module, name in bound]


def _assigned(tree: ast.Module) -> Iterator[tuple[str, ast.expr, int]]:
    """Yield names, values and lines of what a module assigns."""
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            pairs: list[tuple[ast.expr, ast.expr]] = [(node.target, node.value)]
        elif isinstance(node, ast.Assign):
            pairs = [(target, node.value) for target in node.targets]
        else:
            continue
        for target, value in pairs:
            own = [(target, value)]
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                own = list(zip(target.elts, value.elts, strict=False))
            for name, its_value in own:
                if isinstance(name, ast.Name):
                    yield name.id, its_value, node.lineno


def _holds_number(value: ast.expr) -> bool:
    return any(
        isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and not isinstance(node.value, bool)
        for node in ast.walk(value)
    )


def _use(source: Source, name: str) -> Use:
    made, fixed, names = [], [], {name}
    for node in source.tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            continue
        loads = [own.lineno for own in _at_import(node) if own.id in names]
        targets = [(own, value) for own, value, _ in _assigned(ast.Module([node], []))]
        for own, value in targets:
            if own != name and any(
                isinstance(load, ast.Name) and load.id in names for load in ast.walk(value)
            ):
                made.append((own, ast.unparse(value)))
                names.add(own)
        if loads and not targets:
            fixed += loads
    places = frozenset(_loads(source.code, names, str(source.path)))
    return Use(source.name, name, tuple(made), tuple(fixed), places)


def _at_import(node: ast.stmt) -> Iterator[ast.Name]:
    """Yield the names that a statement loads when its module is imported."""
    todo: list[ast.AST] = [node]
    while todo:
        own = todo.pop()
        if isinstance(own, ast.Name) and isinstance(own.ctx, ast.Load):
            yield own
        if isinstance(own, ast.FunctionDef | ast.Lambda):
            arguments = own.args
            todo += [*arguments.defaults, *(d for d in arguments.kw_defaults if d)]
            todo += own.decorator_list if isinstance(own, ast.FunctionDef) else []
        elif not isinstance(own, ast.Name):
            todo += ast.iter_child_nodes(own)


def _loads(code: CodeType, names: set[str], path: str, inner: bool = False) -> Iterator[Place]:
    """Yield the lines of functions that load global names, or import them."""
    if inner:
        for step in dis.get_instructions(code):
            known = step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "IMPORT_FROM", "LOAD_ATTR")
            if known and step.argval in names and step.positions and step.positions.lineno:
                yield path, step.positions.lineno
    for own in code.co_consts:
        if isinstance(own, CodeType):
            yield from _loads(own, names, path, inner=True)
