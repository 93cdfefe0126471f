"""From the camera's coordinates to the test's: rim plane z = 0, its centre the origin, x the warp.

Everything here takes and gives arrays in mm; `register` puts the steps together.
"""

from __future__ import annotations
