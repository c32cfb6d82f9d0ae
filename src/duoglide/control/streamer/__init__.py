"""The real-time process: the cycle, when and how to stop, and the next setpoint."""
