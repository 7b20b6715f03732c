"""`python -m ident` is the command `ident`."""

from ident.command_line.cli import main

if __name__ == "__main__":
    main()
