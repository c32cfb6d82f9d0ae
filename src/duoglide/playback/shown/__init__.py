"""Plans and runs for programs that show robots: Foxglove, Rerun, ROS 2."""
