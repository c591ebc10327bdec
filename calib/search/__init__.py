"""Find where to start: templates, turns of the whole sheet, selections, alternatives."""
