"""Write, read and monitor runs."""
