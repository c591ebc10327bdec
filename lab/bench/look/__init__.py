"""The drawn look: CPU seconds against what eyes see, every part of it left out in turn."""
