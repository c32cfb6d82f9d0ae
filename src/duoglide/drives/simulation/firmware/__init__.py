"""The application of a linear-axis drive: what its firmware does, in plain Python."""
