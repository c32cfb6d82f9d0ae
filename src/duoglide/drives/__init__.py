"""Linear-axis drives over CANopen (CiA 301, CiA 402), real and simulated."""
