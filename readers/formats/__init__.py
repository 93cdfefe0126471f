"""Formats of data files, one module each, which ends in `register_format`; found by their place."""
