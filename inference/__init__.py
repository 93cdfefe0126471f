"""Objectives, feasibility, optimisers and the multistart study."""
