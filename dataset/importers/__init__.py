"""Other programs' cameras and pictures as bundles."""
