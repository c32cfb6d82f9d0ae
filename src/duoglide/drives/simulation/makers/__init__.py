"""Drives of other makers, simulated: in what they differ from the contract, as data."""
