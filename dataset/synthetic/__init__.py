"""Draw synthetic turnarounds with their exact truth."""
