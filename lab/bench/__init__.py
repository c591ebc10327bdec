"""Speed against accuracy: records, charts, benchmarks."""
