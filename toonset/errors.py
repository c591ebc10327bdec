"""Define the errors a user can cause, as one tree, and the words of messages.

    ToonsetError            exit code 2: bad input or usage; one line says where, what, what to do
    |- CameraError          a camera that cannot exist
    |- PictureError         an image file that cannot be read or is not supported
    |- SheetError           a picture without usable figures
    |- MeshError            a mesh file that cannot be read or is not a surface
    |- LandmarkError        a landmark file that cannot be read, or landmarks without a camera
    |- BundleError          a bundle or transforms.json folder that is broken
    |- PaletteError         palette colours that cannot be used
    |- OutputError          a place that cannot be written
    |- UsageError          arguments that contradict each other
    |- SetupError           a missing system library; the message holds the install line

Numeric doubt is never an exception: it is returned as data (verdicts, probabilities, residuals).
Foreign text in messages (a file's content, a name) is shown on one printable line.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class ToonsetError(Exception):
    """A user's mistake. The message says where, what was found, what is needed, what to do."""


class CameraError(ToonsetError):
    """A camera that cannot exist."""


class PictureError(ToonsetError):
    """An image file that cannot be read or is not supported."""


class SheetError(ToonsetError):
    """A picture without usable figures."""


class MeshError(ToonsetError):
    """A mesh file that cannot be read or is not a surface."""


class LandmarkError(ToonsetError):
    """A landmark file that cannot be read, or landmarks that determine no camera."""


class BundleError(ToonsetError):
    """A bundle or transforms.json folder that is broken."""


class PaletteError(ToonsetError):
    """Palette colours that cannot be used."""


class OutputError(ToonsetError):
    """A place that cannot be written."""


class UsageError(ToonsetError):
    """Arguments that contradict each other."""


class SetupError(ToonsetError):
    """A missing system library; the message holds the install line."""


def printable(text: str) -> str:
    """Return the text with "?" for every control character and line end."""
    return "".join(c if c.isprintable() else "?" for c in text)


def as_text(name: str) -> str:
    """Return a file's name with U+FFFD for the bytes that are no text."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def one_line(message: object) -> str:
    """Return a message on one printable line, runs of white space as one space."""
    return printable(" ".join(str(message).split()))


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return "did you mean 'front'?" with the nearest choice; "" if none is near."""
    near = get_close_matches(word, list(choices), 1)
    return f"did you mean {near[0]!r}?" if near else ""


def counted(number: int, thing: str) -> str:
    """Return a number of things in words: "1 view", "2,000 views"."""
    return f"{number:,} {thing}" + "s" * (number != 1)


def duration(seconds: float) -> str:
    """Return seconds as people say them: "8 s", "3 min 20 s", "2 h 5 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
