"""Find a character's palette, and label its pixels."""
