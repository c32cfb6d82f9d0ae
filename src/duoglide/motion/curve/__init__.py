"""A curve in space, bounds on it, and pictures of it."""
