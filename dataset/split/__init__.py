"""Segment one sheet: background, figures, what is left out, cut-outs with alpha."""
