"""Split sheets into views, read and write bundles, draw synthetic turnarounds."""
