"""Charts of cost against merit."""
