"""``python -m duoglide``: the command line without its script."""

from duoglide.cli.main import main

main()
