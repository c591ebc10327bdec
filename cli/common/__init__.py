"""Share options, inputs and printing among verbs."""
