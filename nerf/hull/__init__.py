"""Estimate the drawn body: its visual hull, or the mannequin where that is the body."""
