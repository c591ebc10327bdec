"""Make the flags of a verb from the options that it takes.

A verb's parameter whose type is a dataclass of options (`toonset.options`) stands for its fields:
each is a flag in that place, with the help, range and default that the field states. The verb is
called with the dataclass filled, or with `Given` options where others may be their base.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar, get_args, get_origin, get_type_hints

import typer

from toonset.errors import did_you_mean
from toonset.options import OptionField, fields_of, is_described

Options = TypeVar("Options")
NOT_TYPED = ("DEFAULT", "DEFAULT_MAP")  # where the value of a flag comes from otherwise


@dataclass(frozen=True)
class Given(Generic[Options]):
    """The options that were typed.

    Attributes:
        kind: the dataclass that they are of.
        values: by field.
    """

    kind: type[Options]
    values: Mapping[str, Any] = field(default_factory=dict)

    def over(self, base: Options) -> Options:
        """Return other options with those that were typed in their places."""
        return replace(base, **self.values)  # type: ignore[type-var]


def command_of(verb: Callable[..., None], without: Container[str] = ()) -> Callable[..., None]:
    """Return a function for typer with a parameter for every flag of a verb.

    It is never called: `arguments_of` says what the verb is to be called with.

    Args:
        verb: the verb.
        without: parameters of its own that a person is not asked for.
    """
    shown: dict[str, inspect.Parameter] = {}
    hints = get_type_hints(verb, include_extras=True)
    for name, parameter in inspect.signature(verb).parameters.items():
        options, _ = _options_in(hints[name])
        if name in without:
            continue
        if options is None:
            own = [parameter.replace(annotation=hints[name], kind=parameter.KEYWORD_ONLY)]
        else:
            own = [_parameter(one) for one in _flags_in(options)]
        for one in own:
            shown.setdefault(one.name, one)  # two kinds of options may share one flag

    def flags(**values: Any) -> None:
        raise AssertionError("a verb is called with what arguments_of returns")

    flags.__doc__, flags.__name__ = verb.__doc__, verb.__name__
    flags.__signature__ = inspect.Signature([*shown.values()])  # type: ignore[attr-defined]
    flags.__annotations__ = {name: one.annotation for name, one in shown.items()}
    flags.verb, flags.without = verb, without  # type: ignore[attr-defined]
    return flags


def verb_of(command: Any) -> Callable[..., None]:
    """Return the verb of a command whose flags `command_of` made."""
    found: Callable[..., None] = command.callback.verb
    return found


def arguments_of(context: Any) -> dict[str, Any]:
    """Return what to call the verb of a parsed command line with, by parameter.

    Raises:
        ToonsetError: options that are refused when they are made.
    """
    verb, values = verb_of(context.command), context.params
    hints, found = get_type_hints(verb, include_extras=True), {}
    lists = {param.name for param in context.command.params if _is_list(param)}
    for name in inspect.signature(verb).parameters:
        if name in context.command.callback.without:
            continue
        options, is_given = _options_in(hints[name])
        if options is None:
            value = values[name]
            found[name] = (list(value) or None) if name in lists and value is not None else value
            continue
        flags = [one for one in _flags_in(options) if not is_given or _is_typed(context, one.name)]
        own = {one.name: _value(one, values[one.name], context) for one in flags}
        found[name] = Given(options, own) if is_given else options(**own)
    return found


def each_of(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return a verb's arguments with every option of its options by the option's own name."""
    found: dict[str, Any] = {}
    for name, value in arguments.items():
        if isinstance(value, Given):
            value = value.over(value.kind())
        if is_described(type(value)):
            found |= {one.name: getattr(value, one.name) for one in fields_of(value)}
        else:
            found[name] = value
    return found


def _is_list(param: Any) -> bool:
    return bool(getattr(param, "multiple", False)) or param.nargs == -1


def _options_in(hint: Any) -> tuple[Any, bool]:
    """Return the options that a parameter takes, None of another one; and if only typed ones."""
    is_given = get_origin(hint) is Given
    options = get_args(hint)[0] if is_given else hint
    return (options, is_given) if is_described(options) else (None, False)


def _flags_in(options: Any) -> Iterable[OptionField]:
    return (one for one in fields_of(options) if one.option.flag is not None)


def _is_typed(context: Any, name: str) -> bool:
    source = context.get_parameter_source(name)
    return source is not None and source.name not in NOT_TYPED


def flag_of(one: OptionField) -> str:
    """Return the flag of an option, with its other side where it has one."""
    return one.option.flag or f"--{one.name.replace('_', '-')}"


def _parameter(one: OptionField) -> inspect.Parameter:
    """Return one option as a parameter that typer understands."""
    option, default, choices = one.option, one.field.default, "|".join(one.choices)
    kind: Any = Path if Path in one.kinds else one.kinds[0]
    metavar, complete = option.metavar or None, None
    if option.listed:
        kind, default, complete = str | None, None, _completion(one.choices)
        metavar = metavar or f"<{choices}>,..."
    elif one.is_tuple:
        member: Any = _choice(one.choices) if choices else kind
        kind, default = list[member] | None, None
        metavar = metavar or (f"<{choices}>" if choices else None)
    elif one.is_off:
        default = False
    elif one.is_optional:
        kind = kind | None
    flag = typer.Option(
        *flag_of(one).split(" "),
        help=option.help,
        metavar=metavar,
        case_sensitive=not option.any_case,
        min=option.least,
        max=option.most,
        autocompletion=complete,
        show_default=default is not None,
        rich_help_panel=option.panel or None,
    )
    shown = Annotated[kind, flag]
    return inspect.Parameter(
        one.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=shown
    )


def _choice(names: tuple[str, ...]) -> Any:
    """Return a type of a few names, which typer takes several of."""
    return StrEnum("Choice", [(name, name) for name in names])


def _value(one: OptionField, typed: Any, context: Any) -> Any:
    """Return the value of an option from what was typed, or from the parameter's default."""
    if one.option.listed:
        return _names(one, typed or "", context)
    if one.is_tuple:
        return tuple(value.value if isinstance(value, Enum) else value for value in typed or ())
    if one.is_off:
        return not typed
    return math.radians(typed) if one.option.in_degrees and typed is not None else typed


def _names(one: OptionField, typed: str, context: Any) -> tuple[str, ...]:
    """Return names that were typed with commas between them, each once."""
    names = tuple(dict.fromkeys(word.strip() for word in typed.split(","))) if typed else ()
    for name in names:
        if name not in one.choices:
            near = did_you_mean(name, one.choices)
            said = f"{name!r} is none of {', '.join(one.choices)}" + (f"; {near}" if near else "")
            raise typer.BadParameter(said, ctx=context, param_hint=flag_of(one))
    return names


def _completion(choices: tuple[str, ...]) -> Callable[[str], list[str]]:
    """Return what completes the last name of a list."""

    def complete(incomplete: str) -> list[str]:
        done, comma, last = incomplete.rpartition(",")
        others = [name for name in choices if name not in done.split(",")]
        return [f"{done}{comma}{name}" for name in others if name.startswith(last)]

    return complete
