"""Sheets to views, bundles on disk, synthetic turnarounds."""
