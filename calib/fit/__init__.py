"""Fit cameras: one view, the sheet, the camera model, the mannequin's proportions."""
