"""A history as bytes and back: what a store of runs holds of one, compressed and checked."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import fields
from typing import Any

import numpy as np

from ..notes import Note, NoteKind, as_note
from .base import History

#: First bytes of every file: what it is, and of which layout.
TITLE = b"bubblefit run 1\n"
#: Fields that are no arrays, and are words instead.
WORDS = ("iterations", "unstable", "remarks", "early")
#: Not of the run itself.
NOT_WRITTEN = ("seconds", "from_cache")


class Damaged(ValueError):
    """Bytes that are not what was written."""


def to_bytes(history: History, key: str, seconds: float) -> bytes:
    """The history with its key and the seconds it took, behind a checksum of all of it.

    Raises
    ------
    ValueError, TypeError : it holds what is no result of numbers: a plug-in's own sort of history,
        objects in place of numbers, numbers that are not finite.
    """
    if type(history) is not History:
        raise TypeError(f"{type(history).__name__} is not a History")
    arrays: dict[str, Any] = {}
    for name in (field.name for field in fields(History)):
        value = getattr(history, name)
        if name in WORDS or name in NOT_WRITTEN or value is None:
            continue
        if name == "reactions":
            arrays |= {f"reactions of {of}": _numbers(value[of], name) for of in value}
        else:
            arrays[name] = _numbers(value, name)
    remarks = [(note.kind, str(note), note.of) for note in map(as_note, history.remarks)]
    unstable = None if history.unstable is None else list(map(str, history.unstable))
    words = {
        "key": key,
        "seconds": float(seconds),
        "iterations": int(history.iterations),
        "unstable": unstable,
        "remarks": remarks,
        "early": str(history.early),
    }
    content = io.BytesIO()
    np.savez_compressed(content, words=np.array(json.dumps(words)), **arrays)
    whole = content.getvalue()
    return TITLE + hashlib.sha256(whole).digest() + whole


def from_bytes(content: bytes, key: str) -> History:
    """The history that `to_bytes` wrote under this key, every number as it was, with its seconds.

    Raises
    ------
    Damaged : cut off, changed, of another layout, or of another key; says which.
    """
    start = len(TITLE) + hashlib.sha256().digest_size
    if not content.startswith(TITLE):
        raise Damaged("it is not a run that was kept, or of another version")
    if hashlib.sha256(content[start:]).digest() != content[len(TITLE) : start]:
        raise Damaged("its checksum is wrong")
    # The checksum is no proof against somebody who writes one: nothing is ever unpickled.
    try:
        with np.load(io.BytesIO(content[start:]), allow_pickle=False) as arrays:
            words = json.loads(str(arrays["words"]))
            if words["key"] != key:
                raise Damaged("it is of another run")
            there: dict[str, Any] = {
                name: np.array(arrays[name]) for name in arrays.files if name != "words"
            }
        reactions = {
            name.removeprefix("reactions of "): there.pop(name)
            for name in list(there)
            if name.startswith("reactions of ")
        }
        return History(
            **there,
            reactions=reactions,
            iterations=int(words["iterations"]),
            unstable=None if words["unstable"] is None else tuple(words["unstable"]),
            remarks=tuple(Note(NoteKind(kind), said, of) for kind, said, of in words["remarks"]),
            early=str(words["early"]),
            seconds=float(words["seconds"]),
            from_cache=True,
        )
    except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, Damaged):
            raise
        raise Damaged(f"it cannot be read ({error})") from None


def _numbers(value: Any, name: str) -> Any:
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or not np.isfinite(array).all():
        raise ValueError(f"{name} is not all finite numbers")
    return array
