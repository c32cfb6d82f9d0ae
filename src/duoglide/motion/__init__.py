"""What flows: paths, checked paths, carriage paths, trajectories."""
