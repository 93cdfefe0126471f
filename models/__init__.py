"""Finite element problems as plain data, known to no solver."""
