"""Commands of the terminal: parse the options, call the library, print the outcome."""
