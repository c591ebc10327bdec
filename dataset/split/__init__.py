"""Segment one sheet: background, figures, what is none of them, cut-outs with alpha."""
