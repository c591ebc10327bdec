"""Sheets as files: load and cut them, the folder of `toonset split`, corrections by hand."""
