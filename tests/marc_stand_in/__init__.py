"""A stand-in for MSC Marc: reads a deck as strictly as Marc, solves it, writes what Marc writes.

For tests, and for trying the adapter where there is no licence.
"""
