"""A drive as a node on a CANopen bus: its objects, its process data and its memory."""
