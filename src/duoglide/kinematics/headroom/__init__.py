"""How far everything is from its limit where the carriages stand, or may stand."""
