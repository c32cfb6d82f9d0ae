"""CAN buses: how they are named and opened, what is heard on one, and how full it gets."""
