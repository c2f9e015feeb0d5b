"""``python3 -m latinpc``: the command line, with the Python at hand."""

from latinpc.cli import main

main()
