"""Read and write palette files of this and other programs."""
