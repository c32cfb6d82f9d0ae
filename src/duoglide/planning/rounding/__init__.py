"""Which blends round the corners of a path, so that the motion is quick."""
