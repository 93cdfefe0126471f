"""A look at the data of a project's tests before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..errors import InputError
from ..experiments.kinds import Expected, FittableTest, Judgement, judged
from ..experiments.registry import kinds
from ..files import __version__
from ..materials.forms.base import COMPONENTS
from ..project.project import Project
from .presenters import write_report
from .setup import FitSetup, prepare_fit


def expected_of(setup: FitSetup) -> Expected:
    """The moduli at rest that the bounds of the law allow, MPa."""
    bounds, law = setup.bounds, setup.law
    if bounds.largest is not None:
        return Expected({n: (bounds.least[n], bounds.largest[n]) for n in COMPONENTS})
    assert bounds.lower is not None and bounds.upper is not None
    free = list(law.form.free)
    ends = []
    for entries in (bounds.lower, bounds.upper):
        beta = np.zeros(len(law.form.labels))
        beta[free] = entries
        ends.append({name: float(law.with_beta(beta).modulus(name, 0.0)) for name in COMPONENTS})
    low, high = ends
    least = {name: max(low[name], bounds.least[name]) for name in COMPONENTS}
    return Expected({n: (least[n], max(high[n], least[n])) for n in COMPONENTS})


def judge(setup: FitSetup) -> tuple[Judgement, ...]:
    """The doubts of every test whose kind looks at its data; some are trusted by the project.

    Raises
    ------
    InputError : the project trusts what is no doubt's name.
    """
    trust = setup.project.fit.trust
    known = sorted({name for kind in kinds().values() for name in getattr(kind, "doubts", ())})
    for name in trust:
        if name not in known:
            problem = f"there is no doubt {name!r}; there are: {', '.join(known)}"
            raise InputError(setup.project.path, "fit.trust", problem)
    expected = expected_of(setup)
    return tuple(
        judged(one.test.name, look(expected), trust)
        for one in setup.tests
        if (look := getattr(one, "doubts", None)) is not None
    )


NOTHING = "nothing doubtful"


@dataclass(frozen=True, eq=False)
class Check:
    """What was seen of the tests, and what makes them doubtful."""

    setup: FitSetup
    judgements: tuple[Judgement, ...]

    @property
    def sound(self) -> bool:
        """Whether a fit would begin."""
        return not any(judgement.errors for judgement in self.judgements)

    @property
    def result(self) -> dict[str, Any]:
        """Everything in plain values: what check.json holds."""
        tests = {
            j.test: [
                {
                    "name": d.name,
                    "severity": "error" if d.sure else "warning",
                    "trusted": d.name in j.trusted,
                    "text": d.text,
                }
                for d in j.doubts
            ]
            for j in self.judgements
        }
        return {"command": "check", "version": __version__, "sound": self.sound, "tests": tests}

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Test, what it is, name of the doubt, text: a line a doubt, one for a test without."""
        rows = []
        for judgement in self.judgements:
            for doubt in judgement.doubts:
                severity = "error" if doubt.sure else "warning"
                if doubt.name in judgement.trusted:
                    severity = f"trusted {severity}"
                rows.append((judgement.test, severity, doubt.name, doubt.text))
            if not judgement.doubts:
                rows.append((judgement.test, "fine", "", NOTHING))
        return rows

    def lines(self) -> list[str]:
        """For a terminal."""
        return [
            f"{test}: {severity}" + (f" [{name}]: {text}" if name else f": {text}")
            for test, severity, name, text in self.rows()
        ]

    def report(self, folder: Path | str) -> Path:
        """Write check.json, the tests' own figures and report.html; return the page's path.

        Raises
        ------
        OutputError : they cannot be written.
        """
        return write_report(self, folder)


def check(
    project: Project, tests: str | Sequence[str] | None = None, trust: Sequence[str] = ()
) -> Check:
    """Look at the data of tests; of all that can be fitted unless some are named.

    trust : names of doubts that stop nothing, beside those of the project.

    Raises
    ------
    InputError : data that cannot be read, a doubt that there is not. SolverFailure : a known
        solution cannot be run.
    """
    project = project.with_fit(trust=[*project.fit.trust, *trust])
    setup = prepare_fit(project, cast(Sequence[FittableTest], project.chosen(tests, fitted=True)))
    return Check(setup, judge(setup))
