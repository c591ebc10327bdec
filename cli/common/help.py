"""Print help in plain text, with panels, without the 0.3 s of importing rich.

Also what a mistyped choice was meant to be.
"""

from __future__ import annotations

import sys
from typing import Any

import typer
from typer import _completion_shared
from typer.core import TyperCommand, TyperGroup

from toonset.cli.common.flags import arguments_of, verb_of
from toonset.errors import UsageError, did_you_mean

NOTHING_ASKED = 2  # exit code, as of any wrong use
HELP = "help"  # the word, for people who do not try -h
AT_FIRST_TAB = """
if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
  %(complete_func)s "$@"
fi
"""


class Verb(TyperCommand):
    """A verb: its help is arguments, options, then the options' panels, each a paragraph."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb; arguments that contradict each other are named with the verb's help."""
        try:
            return ctx.invoke(verb_of(self), **arguments_of(ctx))
        except UsageError as error:
            raise typer.BadParameter(str(error), ctx=ctx) from error

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments; a value that is not a choice is told the choice most like it."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            error.message += _meant(error)
            raise

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write every parameter under its panel; a panel comes where its first parameter does."""
        sections: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is None:
                continue
            name, text = record
            if param.param_type_name == "argument":
                title, name = "Arguments", name.split(" <")[0]  # its type says nothing to people
            else:
                title = getattr(param, "rich_help_panel", None) or "Options"
            sections.setdefault(title, []).append((name, text))
        for title, rows in sections.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


class Verbs(TyperGroup):
    """The program's help: every verb with the whole first paragraph of its own."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Show the help where nothing is asked for; `help VERB` is `VERB --help`."""
        if not args and not ctx.resilient_parsing:  # shells complete so
            print(ctx.get_help(), file=sys.stderr)
            raise typer.Exit(NOTHING_ASKED)
        if args[:1] == [HELP]:
            args = [*args[1:], "--help"]
        return super().parse_args(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write all verbs in the order in which they are used."""
        rows = [
            (name, " ".join((command.help or "").split("\n\n")[0].split()))
            for name, command in self.commands.items()
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def complete_at_first_tab() -> None:
    """Let zsh complete at the first Tab of a session, too.

    It loads the script then; typer's own script only says what completes from the next Tab on.
    """
    scripts: dict[str, str] = _completion_shared._completion_scripts
    if not scripts["zsh"].endswith(AT_FIRST_TAB):
        scripts["zsh"] += AT_FIRST_TAB


def _meant(error: Any) -> str:
    """Return what to say after a refused value of an option with choices."""
    choices = error.param.type_descriptor.choices if error.param is not None else None
    if choices is None or error.__cause__ is None:
        return ""
    given = str(error.__cause__.errors()[0]["input"])
    near = did_you_mean(given, map(str, choices))
    return f" D{near[1:]}" if near else ""
