"""Cut figures apart that touch each other."""
