"""Strip tests: cut strips pulled along warp, fill and 45 degrees, loads over a gauge's length."""

from ..base import Kind
from .kind import Strips

KIND: Kind = Strips()
