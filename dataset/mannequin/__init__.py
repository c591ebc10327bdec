"""A plain body made by code; landmarks, named points of a mannequin and pixels that show them."""
