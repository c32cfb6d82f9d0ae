"""The user's process: the machine as one robot, its runs, what they were like, and their log."""
