"""Records of made-up figures, for tests of charts and pages."""

from __future__ import annotations

from bench.records.record import Record, summarise


def record(metric: str, method: str, by_case: dict[str, float], group: str = "exact") -> Record:
    """Return the record of a method whose figure in every case is given."""
    return summarise(
        list(by_case.values()),
        method=method,
        metric=metric,
        unit="s" if "seconds" in metric else "dB",
        direction="lower" if "seconds" in metric else "higher",
        seed=0,
        group=group,
        by_case=by_case,
    )
