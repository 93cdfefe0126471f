"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from ..base import Kind
from .kind import Biaxial

KIND: Kind = Biaxial()
