"""Find the camera of every drawing from views and a mannequin, with uncertainty and verdict."""
