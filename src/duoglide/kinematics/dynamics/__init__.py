"""Forces and motion: the dynamics in closed form, with one constant mass matrix."""
