"""Draw a run from all round, in layers that take other colours: what its page shows."""
