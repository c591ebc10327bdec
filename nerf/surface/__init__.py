"""Extract a closed mesh of a field, in palette colours."""
