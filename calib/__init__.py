"""Views and a mannequin to cameras, and how sure they are."""
