"""The verbs of the command line, one a module; each has ``add_to(app)``."""
