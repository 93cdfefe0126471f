"""Predictions ask nothing of a kind of test but its protocol: a made-up kind beside cylinders."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments import registry as kinds_of_test
from bubblefit.experiments.kinds import Exhibit, Output, PredictedRun
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project import project
from bubblefit.project.project import Project, read_project
from bubblefit.runs import predictions
from bubblefit.runs import predictions as prediction_result
from bubblefit.runs.predictions import measured_tests, predict
from bubblefit.solvers import registry
from bubblefit.solvers.base import History

from ..complaints import complaint
from ..cylinder_cases import Formula, write_project


@dataclass(frozen=True)
class Strut:
    """A bar that is pulled by so many mm per mm."""

    strain: float
    thickness: float


@dataclass(frozen=True)
class StrutTest:
    name: str
    kind: str = "strut"

    def models(self, thickness: float = 1.0) -> Mapping[str, Strut]:
        return {"strut": Strut(0.01, thickness)}


class StrutOutcome:
    """Force of a strut, beside 5 N that were measured."""

    def __init__(self, runs: Sequence[PredictedRun]) -> None:
        self.forces = [float(run.record.arrays["force"][0]) for run in runs]

    def ended(self, number: int) -> str:
        return "finished"

    def error(self, number: int) -> float:
        return abs(self.forces[number] / 5.0 - 1.0)

    def numbers(self, number: int) -> Mapping[str, Any]:
        return {"force_N": self.forces[number]}

    columns = numbers

    def curve(self, number: int) -> pd.DataFrame:
        return pd.DataFrame({"force_N": [self.forces[number]]})

    def test_numbers(self, test: StrutTest) -> Mapping[str, Any]:
        return {"measured_N": 5.0}

    def lines(self) -> Sequence[str]:
        return [f"struts: {self.forces}"]

    def show(self, out: Output) -> Exhibit:
        out.path("struts.txt").parent.mkdir(parents=True, exist_ok=True)
        out.path("struts.txt").write_text("struts")
        return Exhibit([("struts", len(self.forces))], files=[(out.name("struts.txt"), "struts")])


class StrutKind:
    name, title, fitted, studied = "strut", "a strut", False, None
    outcome = StrutOutcome

    @property
    def predicted(self) -> StrutKind:
        return self

    def depends_on(self, model: Strut) -> Sequence[object]:
        return (model,)

    def arrays(self, model: Strut, history: History) -> Mapping[str, np.ndarray]:
        return {"force": history.load}

    def early(self, model: Strut, history: History) -> str:
        return history.early

    def measured(self, test: StrutTest) -> bool:
        return True


class Both(Formula):
    """Also pulls struts."""

    def run(self, model: Any, law: HypoelasticLaw, *rest: Any, **named: Any) -> History:
        if not isinstance(model, Strut):
            return super().run(model, law, *rest, **named)
        force = law.beta[11] * model.strain * model.thickness
        strain = np.array([model.strain, 0.0, 0.0])
        return History(np.array([force]), np.zeros((1, 1, 3)), np.zeros(3), strain)


@pytest.fixture
def mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """A project of two cylinders and a strut."""
    kind, ours = StrutKind(), kinds_of_test.kind_named

    def kind_named(name: str) -> Any:
        return kind if name == "strut" else ours(name)

    for module in (prediction_result, predictions):
        monkeypatch.setattr(module, "kind_named", kind_named)
    monkeypatch.setitem(registry.SOLVERS, "formula", Both)
    read = read_project(write_project(tmp_path))
    known = {**kinds_of_test.kinds(), "strut": kind}
    monkeypatch.setattr(project, "kinds", lambda: known)
    return replace(read, tests={"pulled": StrutTest("pulled"), **read.tests})  # type: ignore[dict-item]


def test_two_kinds_in_one_series(mixed: Project, tmp_path: Path) -> None:
    done = predict(mixed, jobs=1, out=tmp_path / "out")
    assert [run.test.name for run in done.each][:2] == ["pulled"] * 2 and len(done.each) == 6
    forces = [0.01 * e1 * 0.81 for e1 in (500.0, 900.0)]
    runs = done.runs()
    np.testing.assert_allclose(runs["force_N"][:2], forces)
    assert runs["force_N"][2:].isna().all() and runs["stiffness_N_per_mm"][2:].notna().all()
    assert done.worst == pytest.approx(max(abs(f / 5 - 1) for f in forces))
    done.report(tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["tests"]["pulled"] == {"kind": "strut", "measured_N": 5.0}
    said = [run.get("force_N") for run in result["runs"]]
    assert said[:2] == pytest.approx(forces) and said[2:] == [None] * 4
    # Each kind has a folder of its own.
    assert (tmp_path / "out" / "strut" / "struts.txt").is_file()
    assert (tmp_path / "out" / "cylinder" / "figures" / "all-loads.png").is_file()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<td>strut/struts.txt</td>" in page
    assert '"labels":["deflection of the collar, mm","load, N"]' in page
    events: list[Any] = []
    predict(mixed, jobs=1, out=tmp_path / "out", resume=True, progress=events.append)
    assert all(event.again for event in events if event is not None and event.run is not None)


def test_one_kind_of_two(mixed: Project) -> None:
    assert [t.name for t in measured_tests(mixed)] == ["pulled"]
    done = predict(mixed, "strut", jobs=1)
    assert {run.test.kind for run in done.each} == {"strut"}
    assert done.lines() == [f"struts: {[0.01 * 500.0 * 0.81, 0.01 * 900.0 * 0.81]}"]


def test_a_kind_that_is_neither_fitted_nor_predicted(
    mixed: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(StrutKind, "predicted", None)
    assert "no card is judged on these tests: pulled" in complaint(predict, mixed, "pulled")
    assert len(predict(mixed, jobs=1).each) == 4
