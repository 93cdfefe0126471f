"""In what a run differs from the one that a folder's results are of, in words."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

#: Of a checksum, what tells two apart for a reader.
DIGITS = 12
#: Beyond, numbers of two lists are not named one by one, and texts are cut.
FEW, LONG = 3, 60
CHECKSUM = re.compile("[0-9a-f]{64}")
NOT_SAID = "not given"

#: Everything that results depend on, in plain values: `version` of bubblefit; `solver`, its name
#: and what it says of itself; `settings`, as the project file says them; `tests`, the settings of
#: each by name; `files`, name and sha256 of the data files of each test, in order.
Facts = Mapping[str, Any]


def differences(before: Facts, now: Facts) -> list[str]:
    """What differs between the facts of two runs, one thing each: key, old value, new value."""
    words = list(_values("version of bubblefit", before.get("version"), now.get("version")))
    words += _solvers(before.get("solver", {}), now.get("solver", {}))
    words += _tables("", before.get("settings", {}), now.get("settings", {}))
    tests, others = before.get("tests", {}), now.get("tests", {})
    if list(tests) != list(others):
        words.append(f"the tests: {', '.join(tests)}, now {', '.join(others)}")
    for name in tests:
        if name in others:
            words += _tables(f"{name}.", tests[name], others[name])
            files = before.get("files", {}).get(name, []), now.get("files", {}).get(name, [])
            words += _files(name, *files)
    return words


def _solvers(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    if before.get("name") != now.get("name"):
        yield from _values("the solver", before.get("name"), now.get("name"))
        return  # what one says of itself, the other cannot
    yield from _tables(f"the solver {now.get('name')}: ", before, now)


def _tables(head: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for key in dict.fromkeys([*before, *now]):
        yield from _values(f"{head}{key}", before.get(key), now.get(key))


def _values(key: str, before: Any, now: Any) -> Iterable[str]:
    if before == now:
        return []
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        return _tables(f"{key}.", before, now)
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = [(i, a, b) for i, (a, b) in enumerate(zip(before, now, strict=True)) if a != b]
        if len(pairs) <= FEW:
            return [words for i, a, b in pairs for words in _values(f"{key}[{i}]", a, b)]
    return [f"{key} = {_said(before)}, now {_said(now)}"]


def _said(value: Any) -> str:
    if value is None:
        return NOT_SAID
    if isinstance(value, str) and CHECKSUM.fullmatch(value):
        return f"sha256 {value[:DIGITS]}"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONG else f"{text[:LONG]}..."


def _files(
    test: str, before: Sequence[Mapping[str, str]], now: Sequence[Mapping[str, str]]
) -> Iterator[str]:
    if len(before) != len(now):
        yield f"{len(before)} data files of {test!r}, now {len(now)}"
        return
    for old, new in zip(before, now, strict=True):
        if old["sha256"] == new["sha256"]:
            continue
        marks = old["sha256"][:DIGITS], new["sha256"][:DIGITS]
        if old["name"] == new["name"]:
            yield f"data file {old['name']} of {test!r} (sha256 {marks[0]}, now {marks[1]})"
        else:
            files = f"{old['name']} ({marks[0]}), now {new['name']} ({marks[1]})"
            yield f"data file of {test!r}, by sha256: {files}"
