"""CalculiX as the reference: decks, the law as a material library, results."""
