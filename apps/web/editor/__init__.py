"""Serve the page that corrects a bundle: its content, its server, refitting."""
