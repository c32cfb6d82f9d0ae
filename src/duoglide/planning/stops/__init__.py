"""Stops along the path: how fast the pace of a motion may change, certified beforehand."""
