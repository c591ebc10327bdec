"""Define radiance fields: the triplane field, its base class and the palette classifier."""
