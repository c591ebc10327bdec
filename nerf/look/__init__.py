"""Render the drawn look: new views blended from the drawings over the field's geometry."""
