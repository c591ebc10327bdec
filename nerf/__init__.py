"""Train triplane radiance fields on bundles, render and score them."""
