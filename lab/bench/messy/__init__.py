"""Draw messy sheets with their truth."""
