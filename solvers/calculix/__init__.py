"""Adapter of CalculiX: input decks, the law as a material library, and reading of results."""
