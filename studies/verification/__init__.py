"""Published and closed-form numbers beside ours: is this program, as it is installed, right?

from bubblefit.studies.verification import numbers
for number in numbers(): print(number.what, number.ours, number.theirs)
"""

from __future__ import annotations

from .number import Number
from .subjects import SUBJECTS, numbers

__all__ = ["SUBJECTS", "Number", "numbers"]
