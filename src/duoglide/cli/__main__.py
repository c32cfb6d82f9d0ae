"""``python -m duoglide.cli``: the command line without its script."""

from duoglide.cli.main import main

main()
