"""Drives that stop by themselves: what is kept then, and where that asks for less speed."""
