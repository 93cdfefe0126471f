"""python -m tests.slow LOG: list the slow tests by a run of all tests with `--durations=0`.

`make test-quick` leaves out what tests/slow.txt names: test functions, and fixtures whose tests
wait for them. Those of the log take their place. Write the log on a quiet machine:
`pytest -n 3 --dist worksteal --durations=0 > LOG`.
"""

import re
import sys
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "slow.txt"
#: Seconds of a test function, all its parameters together, and of a fixture.
MAX_SECONDS = 1.0
MAX_SETUP = 3.0
LINE = re.compile(r"^([\d.]+)s (call|setup|teardown) +(\S+?)(?:\[.*)?$")


def listed() -> list[str]:
    """Return the slow test functions and fixtures, as "tests/runs/test_fit.py::test_name"."""
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def fixtures_of(item: pytest.Item) -> set[str]:
    """Return the fixtures of a test that its file or a folder shares, as `listed` names them."""
    info = getattr(item, "_fixtureinfo", None)
    names = set()
    for name, definitions in (info.name2fixturedefs if info else {}).items():
        for definition in definitions:
            if definition.scope != "function":
                names.add(f"{definition.baseid or 'tests'}::{name}")
    return names


def mark_slow(items: list[pytest.Item]) -> None:
    """Mark the tests that the list names, or a fixture of theirs."""
    names = set(listed())
    for item in items:
        if item.nodeid.split("[")[0] in names or fixtures_of(item) & names:
            item.add_marker(pytest.mark.slow)


def longest_first(items: list[pytest.Item]) -> None:
    """Sort the marked tests to the front, by file as listed: no worker is left with a long one."""
    files = list(dict.fromkeys(name.split("::")[0] for name in listed()))
    rank = {file: number for number, file in enumerate(files)}

    def place(item: pytest.Item) -> int:
        is_slow = item.get_closest_marker("slow") is not None
        return rank.get(item.nodeid.split("::")[0], 0) if is_slow else len(files)

    items.sort(key=place)


class Collected:
    """A plug-in of pytest that keeps what was collected."""

    items: list[pytest.Item]

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.items = session.items


def slow_names(log: str, items: list[pytest.Item]) -> list[str]:
    """Return the slow test functions and fixtures of a log of durations, the longest file first."""
    calls: dict[str, float] = defaultdict(float)
    waits: dict[str, float] = defaultdict(float)
    for line in log.splitlines():
        if match := LINE.match(line):
            seconds, phase, name = float(match[1]), match[2], match[3]
            if phase == "call":
                calls[name] += seconds
            elif phase == "setup":
                waits[name] = max(waits[name], seconds)
    fixtures = {item.nodeid.split("[")[0]: fixtures_of(item) for item in items}
    slow = {name for name, seconds in calls.items() if seconds > MAX_SECONDS}
    for name, seconds in waits.items():
        if seconds > MAX_SETUP:
            folder = name.split("::")[0]
            near = {f for f in fixtures.get(name, ()) if f.startswith(folder)}
            slow |= near or {name}
    of_file: dict[str, float] = defaultdict(float)
    for name, seconds in [*calls.items(), *waits.items()]:
        of_file[name.split("::")[0]] += seconds
    return sorted(slow, key=lambda name: (-of_file[name.split("::")[0]], name))


def main(log: str) -> None:
    """Write the list by a log."""
    collected = Collected()
    pytest.main(["--collect-only", "-q", "-q", str(ROOT / "tests")], plugins=[collected])
    names = slow_names(Path(log).read_text(encoding="utf-8"), collected.items)
    head = "# Slow tests and fixtures, see tests/slow.py.\n"
    LIST.write_text(head + "".join(f"{name}\n" for name in names), encoding="utf-8")
    print(f"{len(names)} slow tests and fixtures in {LIST}")


if __name__ == "__main__":
    main(sys.argv[1])
