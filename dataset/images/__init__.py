"""Pictures: decode and encode them safely."""
