"""`python -m hamel` is the command `hamel`."""

from hamel.cli import main

main()
