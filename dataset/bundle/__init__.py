"""Read and write bundles: cameras, pictures, calibration, palette, labels."""
