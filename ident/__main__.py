"""`python -m ident` is the command `ident`."""

from ident.command_line.cli import main

main()
