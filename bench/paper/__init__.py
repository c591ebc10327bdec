"""The plain method's table and figure."""
