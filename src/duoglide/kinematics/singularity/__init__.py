"""How far a pose is from every singular surface, and from the nearest of them."""
