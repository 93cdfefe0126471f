"""A stand-in for MSC Marc: reads a deck as strictly as Marc, solves it, writes what Marc writes.

For tests, and for trying the adapter where there is no licence. Its parser (fields, parameters,
model, history, checks) was written from docs/reference/marc-deck.md and what public sources show of
Marc. It shares no code with what writes the decks, on purpose: a mistake there must not cancel out
here.
"""
