"""Draw synthetic turnarounds with their ground truth."""
