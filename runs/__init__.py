"""Evaluations as units of work: history, output folder, resume, processes."""
