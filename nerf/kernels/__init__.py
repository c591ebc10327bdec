"""Fast numerics: interpolation, compositing, decoder, losses, threads."""
