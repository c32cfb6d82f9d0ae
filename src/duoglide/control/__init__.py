"""The running machine: three axes as one, the cycle, and when and how to stop."""
