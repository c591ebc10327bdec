"""Read sheets, read and write split folders, apply corrections by hand."""
