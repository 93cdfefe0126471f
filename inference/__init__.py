"""Identify unknowns from residuals: feasibility, optimisers, uncertainty."""
