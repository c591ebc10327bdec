"""Flags are made of options: what is typed fills the dataclass, as its fields say."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import typer

from toonset.calib.options import Hints
from toonset.cli.common.flags import Given, arguments_of, command_of
from toonset.cli.common.help import Verb
from toonset.dataset.split_folder.options import SheetOptions
from toonset.nerf.options import MeshOptions, RenderOptions, TrainOptions
from toonset.options import Option, described
from toonset.palette.options import PaletteOptions

EVERY = (Hints, SheetOptions, PaletteOptions, TrainOptions, RenderOptions, MeshOptions)


@described
@dataclass(frozen=True)
class Brew:
    """How tea is made."""

    cups: Annotated[int, Option("How many.", least=1, most=4)] = 2
    lid: Annotated[bool, Option("Leave the lid off.", flag="--no-lid")] = True
    tilt: Annotated[float | None, Option("Of the pot.", least=0, most=90, in_degrees=True)] = None
    leaves: Annotated[tuple[Literal["green", "black"], ...], Option("Repeatable.")] = ()
    scents: Annotated[tuple[Literal["mint", "rose"], ...], Option("Any.", listed=True)] = ()
    kettle: Annotated[str | Path | None, Option("Of whom.", metavar="FILE")] = None
    secret: Annotated[int, Option("Nobody types it.", flag=None)] = 7


def parsed(verb: Any, *words: str) -> dict[str, Any]:
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(cls=Verb)(command_of(verb))
    command: Any = typer.main.get_command(app)
    return arguments_of(command.make_context("brew", [*words]))


def brew(options: Brew = Brew()) -> None:
    """Make tea."""


def test_nothing_typed_is_the_dataclass() -> None:
    assert parsed(brew) == {"options": Brew()}


def test_typed_values_fill_their_fields() -> None:
    words = ("--cups", "3", "--no-lid", "--tilt", "90", "--scents", "rose, mint,rose")
    files = ("--leaves", "black", "--leaves", "green", "--kettle", "k.json")
    found = parsed(brew, *words, *files)["options"]
    assert found == Brew(
        3, False, math.pi / 2, ("black", "green"), ("rose", "mint"), Path("k.json"), 7
    )


def test_options_with_a_base_are_those_that_were_typed() -> None:
    def over(options: Given[Brew]) -> None:
        """Make tea of a kind."""

    found = parsed(over, "--cups", "2", "--no-lid")["options"]
    assert found.values == {"cups": 2, "lid": False}
    assert found.over(Brew(cups=4, secret=1)) == Brew(cups=2, lid=False, secret=1)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--cups", "5"), "less than or equal to 4"),
        (("--tilt", "91"), "less than or equal to 90"),
        (("--leaves", "gren"), "Did you mean 'green'"),
        (("--scents", "mint,ros"), "'ros' is none of mint, rose; did you mean 'rose'"),
        (("--secret", "1"), "No such option"),
        (("--lid",), "No such option"),
    ],
)
def test_what_no_field_takes_is_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(Exception) as refused:  # noqa: PT011 # typer's own kinds have no names
        parsed(brew, *words)
    assert said in getattr(refused.value, "message", str(refused.value))


def test_two_kinds_of_options_share_a_flag() -> None:
    def both(hints: Hints, cut: SheetOptions) -> None:
        """Take both."""

    found = parsed(both, "--views", "front,back")
    assert found["hints"].labels == found["cut"].labels == "front,back"


@pytest.mark.parametrize("options", EVERY)
def test_every_option_says_what_it_is_for(options: Any) -> None:
    for one in options.__option_fields__:
        assert one.option.help[-1] in ".:"
        assert f"    {one.name}: {one.option.help}" in options.__doc__
