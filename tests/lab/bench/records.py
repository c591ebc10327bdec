"""Records of made-up figures, for tests of charts and pages."""

from __future__ import annotations

from lab.bench.records.record import Record, Recorder


def record(metric: str, method: str, by_case: dict[str, float], group: str = "exact") -> Record:
    """Return the record of a method whose figure in every case is given."""
    seconds = "seconds" in metric
    unit, direction = ("s", "lower") if seconds else ("dB", "higher")
    values = list(by_case.values())
    recorder = Recorder(method, group, 0)
    return recorder.samples(metric, values, unit, direction, by_case)  # type: ignore[arg-type]
