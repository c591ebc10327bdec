"""The drawn look: new views put together from the drawings, over the field's geometry."""
