"""Where test sheets come from: folders, sprites, random bodies."""
