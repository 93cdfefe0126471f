"""Command line of bubblefit: its commands parse options, call the library and print results."""
