"""R9: every numeric option of every verb at its ends and beyond; learning rates a hundredfold."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator
from functools import partial
from typing import Any, get_args

from lab.audit.case import Case, Row, run_cases
from lab.audit.documents import TRAIN
from lab.audit.material import Material
from toonset.cli.common.flags import command_of

BEYOND = ("0", "-1", "1e400", "nan", "inf", "x", "", str(10**12), str(10**30))
# What a verb needs besides; `edit` and `view` serve and draw for long where nothing is refused.
LINES: dict[str, tuple[str, ...]] = {
    "calibrate": ("calibrate", "sheet.png", "--mesh", "none", "-o", "o"),
    "palette": ("palette", "sheet.png", "-o", "o"),
    "train": TRAIN,
    "render": ("render", "r", "--turntable", "1", "--size", "24", "-o", "o"),
    "mesh": ("mesh", "r", "--faces", "200", "-o", "o.glb"),
    "export": ("export", "b", "--to", "nerfstudio", "-o", "o"),
    "mannequin": ("mannequin", "-o", "o.obj"),
    "synth": ("synth", "m.obj", "--views", "2", "--cell", "48", "-o", "o"),
    "edit": ("edit", "nothing.png"),
}
OUTPUTS = ("o", "o.glb", "o.obj", "o.landmarks.json", "o.mtl", "o.png")
RATES = (100.0, 1e4, 1e8, math.nan)


def row(material: Material) -> Row:
    """Run every verb with every number in every option."""
    return run_cases([*options(material), *rates(material)], material.work)


def options(material: Material) -> Iterator[Case]:
    """Yield each option that takes a number with numbers that it should not or just may take."""
    make = partial(material_of, material)
    for verb, line in LINES.items():
        for option, least in numeric_options(verb):
            ends = () if least is None else (str(least - 1), str(least))
            for value in dict.fromkeys((*BEYOND, *ends)):
                given = (*line, f"{option}={value}")
                yield Case(f"{verb} {option}={value}", given, make, outputs=OUTPUTS)


def numeric_options(verb: str) -> Iterator[tuple[str, Any]]:
    """Yield a verb's options that take numbers, and the least number where there is one."""
    flags = command_of(getattr(importlib.import_module(f"toonset.cli.{verb}"), verb))
    for name, hint in flags.__annotations__.items():
        parts: list[Any] = [*get_args(hint), None, None]
        kind, option = parts[:2]
        if {int, float} & {kind, *get_args(kind)} and hasattr(option, "param_decls"):
            words = [word for word in (option.default, *option.param_decls) if word is not ...]
            yield next(iter(words), f"--{name.replace('_', '-')}"), option.min


def material_of(material: Material, folder: Any) -> None:
    """Put what all verbs read into a folder."""
    material.copy_all(folder, "sheet.png", "m.obj")
    material.copy("bundle", folder / "b")
    material.copy("run", folder / "r")


def rates(material: Material) -> Iterator[Case]:
    """Yield trainings that blow up: they must stop with the last good state."""
    for factor in RATES:
        line = (*TRAIN[:3], "60", *TRAIN[4:])
        make = partial(material_of, material)
        yield Case(f"learning rate x {factor:g}", line, make, partial(faster, factor))


def faster(factor: float) -> None:
    """Multiply every learning rate of this process."""
    from torch.optim import Adam

    usual = Adam.__init__

    def start(self: Adam, params: Any, *rest: Any, **options: Any) -> None:
        usual(self, params, *rest, **options)
        for group in self.param_groups:
            group["lr"] *= factor

    Adam.__init__ = start  # type: ignore[method-assign]
