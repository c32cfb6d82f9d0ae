"""How corners become blends: the geometry, without a machine."""
