"""Describe the options of a stage once: what each means, its range, and its flag.

A stage's options are a frozen dataclass. Each field says in its type what it is for:

    @described
    @dataclass(frozen=True)
    class PaletteOptions:
        min_share: Annotated[float, Option("Least share of the character's pixels.")] = 0.05

The command line makes its flags of them (`toonset.cli.common.flags`), `described` the class's
documentation, and `check_ranges` refuses what is out of range. Imports nothing heavy.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import Field, dataclass, fields
from enum import Enum
from numbers import Integral, Real
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from toonset.errors import UsageError

# Left and right of a character. auto: mirror images unless a drawing shows otherwise
Symmetric = Literal["auto", "on", "off"]
SYMMETRIC: tuple[Symmetric, ...] = get_args(Symmetric)


class Body(Enum):
    """What stands in for a mannequin that nobody gives.

    DEFAULT: none where drawings alone are sure of their cameras, else a plain body if it explains
    them better. NONE: no body, whatever the drawings say.
    """

    DEFAULT = "default"
    NONE = "none"


AnyClass = TypeVar("AnyClass", bound=type)
MOST_SEED = MOST_NUMBER = 2**63 - 1  # of an option without a bound of its own


@dataclass(frozen=True)
class Option:
    """What one option is for, in Python and on the command line.

    Attributes:
        help: one or two sentences: meaning, unit, and the default where `None` stands for one; of
            a flag that switches off, what it does.
        flag: "": the field's name; "--budget"; "--lines/--no-lines"; "--no-fairing" of what is on
            without it; None: the command line does not have it.
        metavar: stands for the value in the help; "": its type.
        panel: heading in the help.
        least, most: range, both included.
        in_degrees: radians in Python, degrees on the command line and in the range.
        listed: names joined by commas, not a flag for each.
        any_case: capitals do not matter on the command line.
    """

    help: str
    flag: str | None = ""
    metavar: str = ""
    panel: str = ""
    least: float | None = None
    most: float | None = None
    in_degrees: bool = False
    listed: bool = False
    any_case: bool = False


@dataclass(frozen=True)
class OptionField:
    """A field of options.

    Attributes:
        field: of the dataclass; it has name and default.
        kinds: the types of its values, less `None`; of a tuple, those of its members.
        is_optional: whether it may be `None`.
        is_tuple: whether it holds several values.
        option: what it is for.
    """

    field: Field[Any]
    kinds: tuple[Any, ...]
    is_optional: bool
    is_tuple: bool
    option: Option

    @property
    def name(self) -> str:
        """Return the field's name."""
        return self.field.name

    @property
    def is_off(self) -> bool:
        """Return whether the flag, and the help, say what the option is without."""
        return self.field.default is True and (self.option.flag or "").startswith("--no-")

    @property
    def choices(self) -> tuple[str, ...]:
        """Return the values of an option that has a few; () of any other."""
        literals = (get_args(kind) for kind in self.kinds if get_origin(kind) is Literal)
        return tuple(value for values in literals for value in values)


def described(options: AnyClass) -> AnyClass:
    """Read what the fields of a dataclass are for, and add it to the class's documentation."""
    hints = get_type_hints(options, include_extras=True)
    read = tuple(_read(options, hints))
    options.__option_fields__ = read  # type: ignore[attr-defined]
    rows = "\n".join(f"    {one.name}: {_row(one)}" for one in read)
    options.__doc__ = f"{inspect.getdoc(options) or ''}\n\nAttributes:\n{rows}\n"
    plain = {
        name: get_args(hint)[0] if _is_annotated(hint) else hint for name, hint in hints.items()
    }
    vars(options)["__init__"].__annotations__ = plain  # what a notebook shows of the call
    return options


def fields_of(options: Any) -> tuple[OptionField, ...]:
    """Return the fields of a dataclass, or of one of its kind, that say what they are for."""
    found: tuple[OptionField, ...] = options.__option_fields__
    return found


def is_described(options: Any) -> bool:
    """Return whether something is a class of options."""
    return isinstance(options, type) and hasattr(options, "__option_fields__")


def _read(options: Any, hints: Mapping[str, Any]) -> Iterator[OptionField]:
    for field in fields(options):
        kind, *said = get_args(hints[field.name]) if _is_annotated(hints[field.name]) else (None,)
        for option in said:
            if isinstance(option, Option):
                kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
                plain = tuple(one for one in kinds if one is not type(None))
                is_tuple = any(get_origin(one) is tuple for one in plain)
                members = (get_args(one)[0] if get_origin(one) is tuple else one for one in plain)
                is_optional = type(None) in kinds
                yield OptionField(field, tuple(members), is_optional, is_tuple, option)


def _is_annotated(hint: Any) -> bool:
    return get_origin(hint) is Annotated


def _row(one: OptionField) -> str:
    option = one.option
    said = [option.help]
    ends = [end for end in (option.least, option.most) if end is not None and end < MOST_NUMBER]
    if ends:
        range_of = " to ".join(_number(end) for end in ends) + " or more" * (len(ends) == 1)
        said.append(f"{range_of}{', in degrees' * option.in_degrees}.")
    if one.is_off:
        said.append(f"That is what False does: {option.flag}.")
    elif option.flag:
        said.append(f"Flag: {option.flag}.")
    return " ".join(said)


def check_ranges(options: Any, error: type[Exception] = UsageError, where: str = "") -> None:
    """Refuse options out of range.

    Args:
        options: the dataclass.
        error: what is raised.
        where: begins the message.

    Raises:
        UsageError: or another `error`: a number out of range, a switch that is neither on nor off,
            or a word that is not one of the choices.
    """
    for one in fields_of(options):
        value = getattr(options, one.name)
        if value is None and one.is_optional:
            continue
        every: Any = value if one.is_tuple else (value,)
        for each in every:
            if (wrong := _wrong(one, each)) is not None:
                raise error(f"{where}{one.name}: {wrong}")


def _wrong(one: OptionField, value: Any) -> str | None:
    """Return what is wrong with a value; None where it is fine."""
    option = one.option
    if one.choices and value not in one.choices:
        known = ", ".join(("None",) * one.is_optional + one.choices)
        return f"{value!r} is none of {known}; choose one"
    if one.kinds == (bool,) and not isinstance(value, bool):
        return f"{value!r} is neither True nor False; give one"
    if option.least is None and option.most is None:
        return None
    low = -MOST_NUMBER if option.least is None else option.least
    high = MOST_NUMBER if option.most is None else option.most
    kind: Any = Integral if one.kinds == (int,) else Real
    is_number = isinstance(value, kind) and not isinstance(value, bool)
    if is_number and low <= value <= high:  # NaN is in no range
        return None
    if option.most is None and not (is_number and value > high):
        return f"{value} is out of range; give {low:.15g} or more"
    return f"{value} is out of range; give {low:.15g} to {_number(high)}"


def _number(value: float) -> str:
    """Return a bound as it is typed."""
    return str(value) if isinstance(value, int) else f"{value:.15g}"
