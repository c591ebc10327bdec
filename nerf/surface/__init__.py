"""A closed mesh of a field, in palette colours."""
