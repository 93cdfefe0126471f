"""`python -m bubblefit`: the command line where no command is on the PATH."""

from .cli.main import main

main()
