"""Foreign text in messages: whatever a file or a name holds, it is shown on one printable line."""

from __future__ import annotations


def printable(text: str) -> str:
    """Return the text with "?" for every control character and line end."""
    return "".join(c if c.isprintable() else "?" for c in text)


def one_line(message: object) -> str:
    """Return a message on one printable line, runs of white space as one space."""
    return printable(" ".join(str(message).split()))
