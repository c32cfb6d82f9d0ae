"""Programs: files of paths, generators of paths, and their plans one after the other."""
