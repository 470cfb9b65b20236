"""The strain of an area: one affine displacement field through all its ZOIs."""
