"""A bundle on disk: cameras, pictures, calibration, palette, labels."""
