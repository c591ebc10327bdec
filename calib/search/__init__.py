"""Search initial cameras: templates, turns of the whole sheet, selections, alternatives."""
