"""Set the process up for training: keep freed memory."""

from __future__ import annotations

import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of glibc's <malloc.h>
LARGEST_KEPT = 1 << 25  # bytes; glibc takes no more
FREE_KEPT = 1 << 29  # bytes at the heap's end


def keep_freed_memory() -> None:
    """Let this process keep blocks that it frees, instead of handing them back to the system.

    A training takes and frees the same megabytes a thousand times. Handed back, every page is
    cleared and mapped anew (docs/decisions.md). Only glibc can be told.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return
    mallopt(MMAP_THRESHOLD, LARGEST_KEPT)
    mallopt(TRIM_THRESHOLD, FREE_KEPT)
