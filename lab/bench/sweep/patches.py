"""Halve and double a named number wherever it is bound, what is made of it included."""

from __future__ import annotations

import ast
import builtins
import operator
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from lab.bench.sweep.numbers import Named, Use

Way = Literal["half", "double", "none", "huge"]
WAYS: tuple[Way, ...] = ("half", "double")
EXTREMES: tuple[Way, ...] = ("none", "huge")  # of what half and double of move nothing
HUGE = 1000  # times
LARGEST_LEVEL, MIDDLE_LEVEL = 255, 128
OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Pow: operator.pow,
    ast.LShift: operator.lshift,
}


class FixedError(Exception):
    """A number that cannot be changed once its module is imported."""


def changed(value: Any, way: Way | float) -> Any:
    """Return half or double of a number, 0 or 1000 times it, so many times it; of each of several.

    Integers are rounded and change by one at least. What is over a half of its range doubles to
    half way to its end: shares to 1, levels to 255.

    Raises:
        FixedError: it holds no number that can be changed.
    """
    if isinstance(value, bool | np.bool_):
        raise FixedError("a truth value")
    if isinstance(value, np.generic):
        return changed(np.array([value]), way)[0]
    if isinstance(value, int):
        return _whole(value, way)
    if isinstance(value, float):
        return _real(value, way)
    if isinstance(value, np.ndarray):
        whole = np.issubdtype(value.dtype, np.integer)
        if not whole and not np.issubdtype(value.dtype, np.floating):
            raise FixedError(f"an array of {value.dtype}")
        new = [_whole(int(one), way) if whole else _real(float(one), way) for one in value.flat]
        most = np.iinfo(value.dtype).max if whole else np.inf
        return np.minimum(new, most).astype(value.dtype).reshape(value.shape)
    if isinstance(value, dict):
        return dict(zip(value, _each(value.values(), way), strict=True))
    if type(value) in (list, tuple, frozenset, set):
        return type(value)(_each(value, way))
    raise FixedError(f"a {type(value).__name__}")


def patch(number: Named, uses: Sequence[Use], way: Way | float) -> Any:
    """Change a number in this process, for good, and return its new value.

    Raises:
        FixedError: it cannot be changed, or all that uses it has used it at import.
    """
    value = changed(vars(sys.modules[number.module])[number.name], way)
    if not any(use.places for use in uses):
        raise FixedError("no function uses it")
    for use in uses:
        module = sys.modules.get(use.module)
        if module is None:
            continue
        vars(module)[use.name] = value
        for name, source in use.made:
            try:
                own = _made(ast.parse(source, mode="eval").body, vars(module))
            except (KeyError, TypeError, ValueError, ArithmeticError) as error:
                raise FixedError(f"{name} cannot be made again") from error
            for bound in _bindings(name, vars(module).get(name)):
                vars(bound)[name] = own
            vars(module)[name] = own
    return value


def _made(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """Return what an expression of numbers, names and calls comes to.

    Raises:
        FixedError: it is made of anything else.
    """
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.Name):
        return names[node.id] if node.id in names else vars(builtins)[node.id]
    if isinstance(node, ast.Attribute):
        return getattr(_made(node.value, names), node.attr)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](_made(node.left, names), _made(node.right, names))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_made(node.operand, names)
    if isinstance(node, ast.Tuple):
        return tuple(_made(own, names) for own in node.elts)
    if isinstance(node, ast.Call):
        options = {own.arg: _made(own.value, names) for own in node.keywords if own.arg}
        arguments = [_made(own, names) for own in node.args]
        return _made(node.func, names)(*arguments, **options)
    raise FixedError(f"{ast.unparse(node)} cannot be made again")


def _bindings(name: str, value: Any) -> list[Any]:
    """Return the modules that hold the same object by the same name."""
    ours = [own for key, own in sys.modules.items() if key.startswith("toonset.")]
    return [own for own in ours if vars(own).get(name, FixedError) is value]


def _each(values: Iterable[Any], way: Way | float) -> list[Any]:
    """Return values of which those that hold numbers are changed; there must be some."""
    new, any_changed = [], False
    for value in values:
        try:
            new.append(changed(value, way))
            any_changed = True
        except FixedError:
            new.append(value)
    if not any_changed:
        raise FixedError("a collection without numbers")
    return new


def _whole(value: int, way: Way | float) -> int:
    if isinstance(way, float):
        return round(way * value)
    if way in EXTREMES:
        return HUGE * value if way == "huge" else 0
    if way == "half":
        new = round(value / 2)
        return new if new != value else value - 1
    if MIDDLE_LEVEL <= value < LARGEST_LEVEL:
        return (value + LARGEST_LEVEL + 1) // 2
    return 2 * value if value else 1


def _real(value: float, way: Way | float) -> float:
    if isinstance(way, float):
        return way * value
    if way in EXTREMES:
        return HUGE * value if way == "huge" else 0.0
    if way == "half":
        return value / 2 if value else -0.1
    if 0.5 < value < 1:
        return (1 + value) / 2
    return 2 * value if value else 0.1


def described(value: Any) -> str:
    """Return a value as one short line."""
    text = str(dict(value)) if isinstance(value, Mapping) else repr(value)
    text = " ".join(text.split())
    return text if len(text) <= 80 else text[:77] + "..."
