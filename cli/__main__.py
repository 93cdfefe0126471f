"""`python -m bubblefit.cli` is the `bubblefit` command."""

from .main import main

main(prog_name="bubblefit")
