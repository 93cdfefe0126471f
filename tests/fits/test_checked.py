"""What a look at the data says: result, summary, rows, page."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from bubblefit import __version__
from bubblefit.experiments.kinds import Doubt, Exhibit, Judgement
from bubblefit.reports.content import Report, Table
from bubblefit.runs import check as room
from bubblefit.runs.check import Check

SURE, VAGUE = Doubt("unit", True, "off by 1000"), Doubt("slack", False, "0.2 mm of slack")


def looked(*judgements: Judgement, examine: bool = False) -> Check:
    tests = []
    for judgement in judgements:
        one = SimpleNamespace(test=SimpleNamespace(name=judgement.test))
        if examine:
            one.examine = lambda out, name=judgement.test: Exhibit(
                figures=[(f"{name}.png", name)], facts=[("points", 3)], tables=[Table(name, [], [])]
            )
        tests.append(one)
    setup: Any = SimpleNamespace(tests=tests, project=SimpleNamespace(title="made"))
    return Check(setup, judgements)


ONE = Judgement("one", (SURE, VAGUE), frozenset())
TWO = Judgement("two", (SURE, VAGUE), frozenset({"unit"}))
FINE = Judgement("three", (), frozenset())


def test_rows_and_lines() -> None:
    assert looked(ONE, TWO, FINE).lines() == [
        "one: error [unit]: off by 1000",
        "one: warning [slack]: 0.2 mm of slack",
        "two: trusted error [unit]: off by 1000",
        "two: warning [slack]: 0.2 mm of slack",
        "three: fine: nothing doubtful",
    ]


def test_result() -> None:
    assert looked(TWO, FINE).result == {
        "command": "check",
        "version": __version__,
        "sound": True,
        "tests": {
            "two": [
                {"name": "unit", "severity": "error", "trusted": True, "text": "off by 1000"},
                {"name": "slack", "severity": "warning", "trusted": False,
                 "text": "0.2 mm of slack"},
            ],
            "three": [],
        },
    }  # fmt: skip
    assert not looked(TWO, ONE).sound and looked(FINE).sound


@pytest.mark.parametrize(
    ("judgements", "words"),
    [
        ((ONE, TWO), "A fit would not begin."),
        ((TWO, FINE), "A fit would begin, and carry 2 of the doubts below with it."),
        ((FINE,), "The data are fit to be fitted."),
    ],
)
def test_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, judgements: Any, words: str) -> None:
    seen: list[Report] = []
    monkeypatch.setattr(room, "write_report", lambda _, report: seen.append(report))
    done = looked(*judgements, examine=True)
    done.report(tmp_path / "a" / "b")
    (page,) = seen
    names = [judgement.test for judgement in judgements]
    several = len(names) > 1
    assert (page.title, page.summary) == ("made: a look at the data", words)
    assert page.facts == [(f"{name}: points" if several else "points", 3) for name in names]
    assert page.figures == [(f"{name}.png", name) for name in names]
    first, *own = page.tables
    assert first == Table(
        "Doubts", ["test", "", "doubt", "what was seen"], [[*row] for row in done.rows()],
        text=(1, 2, 3),
    )  # fmt: skip
    assert [table.title for table in own] == names
    told = {
        "one": ["one: off by 1000", "one: 0.2 mm of slack"],
        "two": ["two: off by 1000 (trusted: unit)", "two: 0.2 mm of slack"],
        "three": [],
    }
    assert page.warnings == [line for name in names for line in told[name]]
    assert page.files == [("check.json", "the doubts in plain values")]
    text = (tmp_path / "a" / "b" / "check.json").read_text()
    assert text == json.dumps(done.result, indent=1) + "\n"
