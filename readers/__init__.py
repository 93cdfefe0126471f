"""Readers of measured files, by content or `format`; InputError names file, line and column."""
