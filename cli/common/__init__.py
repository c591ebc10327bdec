"""What several verbs share: options, inputs, what is printed."""
