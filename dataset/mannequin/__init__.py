"""Make a plain body; read landmarks, pairs of its named points and pixels."""
