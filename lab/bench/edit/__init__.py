"""Sheets that come out wrong or ambiguous, corrected as a person would on the page of `edit`."""
