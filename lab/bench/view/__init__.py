"""The page of `toonset view` in a real browser: how like `toonset render`, how fast."""
