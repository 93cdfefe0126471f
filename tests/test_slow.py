"""The list of slow tests, which `make test-quick` leaves out: it names tests that there are."""

from pathlib import Path
from types import SimpleNamespace

from . import slow
from .slow import ROOT, listed, slow_names

LOG = """
2.00s call     tests/a/test_b.py::test_long
0.60s call     tests/a/test_b.py::test_sum[1]
0.60s call     tests/a/test_b.py::test_sum[2 of 3]
0.10s call     tests/a/test_b.py::test_short
9.00s setup    tests/a/test_b.py::test_short
11.0s call     tests/a/test_a.py::test_first
20.0s call     tests/a/test_c.py::test_longest
"""


def test_listed_tests_and_fixtures_exist():
    missing = []
    for name in listed():
        path, _, function = name.partition("::")
        file = ROOT / path
        shared = [*file.rglob("conftest.py"), *file.glob("fixtures.py")]
        texts = [file] if file.is_file() else shared
        function = function.split("::")[-1]
        if not any(f"def {function}(" in text.read_text(encoding="utf-8") for text in texts):
            missing.append(name)
    assert not missing


def test_parameters_count_together_and_fixtures_for_the_tests_that_wait():
    definition = SimpleNamespace(scope="module", baseid="tests/a/test_b.py")
    info = SimpleNamespace(name2fixturedefs={"solved": [definition]})
    item = SimpleNamespace(nodeid="tests/a/test_b.py::test_short", _fixtureinfo=info)
    assert slow_names(LOG, [item]) == [
        "tests/a/test_c.py::test_longest",
        "tests/a/test_b.py::solved",
        "tests/a/test_b.py::test_long",
        "tests/a/test_b.py::test_sum",
        "tests/a/test_a.py::test_first",
    ]


def test_long_files_run_first_and_unmarked_tests_last(monkeypatch):
    monkeypatch.setattr(slow, "listed", lambda: ["tests/b.py::test_long", "tests/a.py::test_slow"])

    def item(name):
        mark = None if name.endswith("quick") else "slow"
        return SimpleNamespace(nodeid=name, get_closest_marker=lambda _: mark)

    names = ["a.py::test_quick", "a.py::test_slow[1]", "b.py::test_long", "b.py::test_quick"]
    items = [item(f"tests/{name}") for name in names]
    slow.longest_first(items)
    ordered = [item.nodeid.removeprefix("tests/") for item in items]
    assert ordered == [names[2], names[1], names[0], names[3]]


def test_quick_run_leaves_the_slow_tests_out():
    makefile = Path(ROOT / "Makefile").read_text(encoding="utf-8")
    assert '-m "not slow"' in makefile.split("test-quick: $(READY)")[1].split("\n\n")[0]
