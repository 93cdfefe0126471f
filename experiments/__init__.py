"""Kinds of test, one folder each: section of a project, data, model, objective, figures."""
