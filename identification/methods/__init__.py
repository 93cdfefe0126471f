"""Optimisers: one file each, one line each in the registry."""

from .base import FitOptions, Method
from .registry import METHODS, method_named

__all__ = ["METHODS", "FitOptions", "Method", "method_named"]
