"""A licensed MSC Marc: decks, runs, results."""
