"""A stand-in for MSC Marc: reads a deck as strictly as Marc, solves it, writes what Marc writes."""
