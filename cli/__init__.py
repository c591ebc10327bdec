"""Parse the command line, call the stages, print."""
