"""What else tells cameras apart: face, paint, coherence of the drawings."""
