"""Paths at every stage: programmed, rounded, checked, seen from the carriages."""
