"""Compare silhouettes: distances, coherence under cameras, registration, displacement."""
