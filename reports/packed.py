"""Arrays as short text: sixteen bits a number, deflated, in base 64; a page unpacks them itself."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Steps between the least and the largest value; one more stands for what is not there.
STEPS = 65534
MISSING = 65535


@dataclass(frozen=True)
class Packed:
    """Numbers of any shape: value = least + step * (0 to `STEPS`), `MISSING` for NaN.

    shape : of the array, in C order. least, step : in the numbers' unit. data : little endian
    unsigned 16 bit, zlib, base 64.
    """

    shape: tuple[int, ...]
    least: float
    step: float
    data: str

    @property
    def values(self) -> Array:
        """The array; each value within half a `step` of what was packed.

        Raises
        ------
        ValueError : the data are damaged, or of another shape.
        """
        count = prod(self.shape)
        try:
            # One byte more than wanted shows what is longer; nothing longer is unpacked.
            raw = zlib.decompressobj().decompress(base64.b64decode(self.data), 2 * count + 1)
        except zlib.error as error:
            raise ValueError(f"packed numbers are damaged: {error}") from None
        if len(raw) != 2 * count:
            raise ValueError(f"packed numbers: {len(raw) // 2}, expected {count}")
        steps = np.frombuffer(raw, dtype="<u2").astype(float)
        steps[steps == MISSING] = np.nan
        return np.asarray(self.least + self.step * steps.reshape(self.shape))


def pack(values: ArrayLike) -> Packed:
    """Numbers as text; infinite ones and NaN are missing."""
    array = np.asarray(values, dtype=float)
    known = np.isfinite(array)
    least = float(array[known].min()) if known.any() else 0.0
    most = float(array[known].max()) if known.any() else 0.0
    step = (most - least) / STEPS or 1.0
    steps = np.full(array.shape, MISSING, dtype="<u2")
    steps[known] = np.rint((array[known] - least) / step)
    data = base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode()
    return Packed(array.shape, least, step, data)
