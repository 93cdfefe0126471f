"""One digest for everything that a result depends on, by content."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass

import numpy as np

from .files import __version__


def digest_of(*things: object) -> str:
    """SHA-256 of this version of bubblefit and of things, told apart by what they hold.

    Numbers, words, None, arrays, and mappings, sequences and dataclasses of such; mappings in
    whatever order.

    Raises
    ------
    TypeError : a thing of which it is not known what it holds.
    """
    digest = hashlib.sha256(__version__.encode())
    for part in _parts(things):
        # Lengths in front: "ab", "c" is not "a", "bc".
        digest.update(f"{len(part)}:".encode())
        digest.update(part)
    return digest.hexdigest()


def _parts(thing: object) -> Iterator[bytes]:
    if thing is None or isinstance(thing, (bool, int, float, str, bytes)):
        yield f"{type(thing).__name__} {thing!r}".encode()
    elif isinstance(thing, np.ndarray):
        yield f"array {thing.dtype.str} {thing.shape}".encode()
        yield np.ascontiguousarray(thing).tobytes()
    elif isinstance(thing, np.generic):
        yield from _parts(thing.item())
    elif is_dataclass(thing):
        yield f"of {type(thing).__name__}".encode()
        for field in fields(thing):
            yield field.name.encode()
            yield from _parts(getattr(thing, field.name))
    elif isinstance(thing, Mapping):
        yield f"mapping {len(thing)}".encode()
        for key in sorted(thing, key=repr):
            yield from _parts(key)
            yield from _parts(thing[key])
    elif isinstance(thing, Sequence):
        yield f"sequence {len(thing)}".encode()
        for item in thing:
            yield from _parts(item)
    else:
        raise TypeError(f"{type(thing).__name__}: what it holds is not known")
