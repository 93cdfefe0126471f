"""Solvers behind one protocol, picked by name."""
