"""From a path to a trajectory: check, time, and motion made online."""
