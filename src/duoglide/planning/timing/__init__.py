"""How fast to go along a curve: the quickest motion within the limits of the carriages."""
