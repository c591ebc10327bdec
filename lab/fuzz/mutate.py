"""Change bytes by lot: flips, cuts, splices, chunks twice, numbers replaced by extreme ones."""

from __future__ import annotations

import json
import random
import re
import struct
import zlib
from collections.abc import Sequence

from lab.audit.mutations import mutate_value

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
NUMBERS = (
    *(b"0", b"-1", b"-0.0", b"1e-300", b"1e300", b"-1e308", b"1e999", b"nan", b"inf", b"0.5"),
    *(b"255", b"256", b"65536", b"2147483648", b"4294967295", b"9223372036854775807", b"9" * 30),
)
WORDS = tuple(
    value.to_bytes(size, order)
    for size in (1, 2, 4, 8)
    for value in (0, 1, 2 ** (8 * size - 1) - 1, 2 ** (8 * size - 1), 2 ** (8 * size) - 1)
    for order in ("little", "big")
)
FLOATS = tuple(
    struct.pack(kind, value)
    for kind in ("<f", "<d")
    for value in (0.0, -1.0, 1e30, float("inf"), float("nan"))
)
MOST_CHANGES = 4
MOST_BYTES = 64_000  # of a mutated input
PNG = b"\x89PNG\r\n\x1a\n"


def mutated(corpus: Sequence[bytes], lot: random.Random) -> bytes:
    """Return one of the corpus with one to four changes; of JSON half the time in its values."""
    data = bytearray(lot.choice(corpus))
    changes = lot.randint(1, MOST_CHANGES)
    if lot.random() < 0.5 and (changed := _changed_values(bytes(data), changes, lot)) is not None:
        return changed
    for _ in range(changes):
        _change(data, corpus, lot)
    whole = bytes(data[:MOST_BYTES])
    return with_checksums(whole) if whole.startswith(PNG) and lot.random() < 0.8 else whole


def _changed_values(data: bytes, changes: int, lot: random.Random) -> bytes | None:
    """Return a JSON document with changed values; None where it is none that has any."""
    try:
        document = json.loads(data)
        for _ in range(changes):
            mutate_value(document, lot)
        return json.dumps(document).encode()
    except (ValueError, IndexError, RecursionError, OverflowError, AttributeError, KeyError):
        return None


def _change(data: bytearray, corpus: Sequence[bytes], lot: random.Random) -> None:
    at = lot.randrange(len(data) + 1)
    length = min(lot.choice((1, 1, 2, 4, 8, 60, 400)), len(data) - at)
    piece = bytes(data[at : at + length])
    other = lot.choice(corpus)
    start = lot.randrange(len(other) + 1)
    kind = lot.randrange(9)
    if kind == 0 and piece:
        data[at] ^= 1 << lot.randrange(8)
    elif kind == 1:
        del data[at:]
    elif kind == 2:
        del data[at : at + length]
    elif kind == 3:
        data[at : at + length] = lot.randbytes(length)
    elif kind == 4:
        data[at:at] = piece * lot.choice((1, 2, 50))
    elif kind == 5:  # another one's end, or a piece of it
        end = start + lot.choice((length, len(other)))
        data[at : at + length] = other[start:end]
    elif kind == 6:
        word = lot.choice(WORDS + FLOATS)
        data[at : at + len(word)] = word
    else:
        numbers = [*NUMBER.finditer(data)]
        if numbers:
            found = lot.choice(numbers)
            data[found.start() : found.end()] = lot.choice(NUMBERS)


def with_checksums(png: bytes) -> bytes:
    """Return a PNG whose chunks have the checksums that readers insist on."""
    data, at = bytearray(png), len(PNG)
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        end = at + 8 + length
        if end + 4 > len(data):
            break
        data[end : end + 4] = zlib.crc32(data[at + 4 : end]).to_bytes(4, "big")
        at = end + 4
    return bytes(data)
