"""The list of what was drawn: printed, and kept in a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from .judging import Verdict


def summary(verdicts: Sequence[Verdict]) -> str:
    """One line of figures."""
    count = Counter(verdict.outcome for verdict in verdicts)
    return (
        f"{len(verdicts)} mutants: {count['caught']} caught, {count['survived']} survived, "
        f"{count['late']} did not end, {count['unrun']} in lines that no test near them runs"
    )


def survivors(verdicts: Sequence[Verdict]) -> str:
    """File, line and change of everything that was not caught, in the order of the files."""
    left = [verdict for verdict in verdicts if verdict.outcome != "caught"]
    words = {
        "survived": "{} tests run it and pass",
        "late": "its {} tests did not end",
        "unrun": "no test near it runs it",
    }
    return "\n".join(
        f"{verdict.mutant}\n  ({words[verdict.outcome].format(verdict.tests)})"
        for verdict in sorted(left, key=lambda verdict: (verdict.mutant.file, verdict.mutant.line))
    )


def caught(verdicts: Sequence[Verdict]) -> str:
    """The same of what was caught, with the test that did."""
    return "\n".join(
        f"{verdict.mutant}\n  ({verdict.by})"
        for verdict in sorted(verdicts, key=lambda verdict: verdict.mutant.file)
        if verdict.outcome == "caught"
    )
