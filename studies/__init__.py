"""Fits and series of analyses: from a project to something ready to run, and to its results."""
