"""Drives that nobody has described yet: what they have, asked of them or of their dictionary."""
