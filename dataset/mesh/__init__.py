"""Read, check and write mesh files."""
