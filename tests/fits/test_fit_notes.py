"""What a reader of a fit should know: on terminal, page, table and in result.json alike."""

from __future__ import annotations

import html
import pickle
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.fits import lines_of
from bubblefit.inference.assessment import certainty
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.notes import Note, NoteKind, foremost, marks, rows
from bubblefit.project.project import read_project
from bubblefit.reports.html import number
from bubblefit.runs.setup import prepare_fit

from ..projects import small


@pytest.fixture(scope="module")
def fitted(tmp_path_factory) -> tuple[bf.Fit, Path]:
    folder = tmp_path_factory.mktemp("told")
    fit = bf.fit(read_project(small(folder)), starts=1, jobs=1)
    fit.report(folder / "out")
    return fit, folder / "out"


def test_notes_stand_everywhere(fitted) -> None:
    fit, out = fitted
    terminal = lines_of(fit, out, every=True)
    page = html.unescape((out / "report.html").read_text())
    table = pd.read_csv(out / "notes.csv", keep_default_na=False).to_dict("records")
    assert table == fit.result["notes"] and len(table) == len(fit.notes) > 1
    for note in fit.notes:
        assert f"note: {note.line}" in terminal and f"<li>{note.line}</li>" in page
    assert "inverse crime" in [row["kind"] for row in table]


def test_the_error_of_the_moduli_names_its_strains(fitted) -> None:
    fit, out = fitted
    (line,) = (line for line in lines_of(fit, out) if "largest error of the moduli" in line)
    page = (out / "report.html").read_text()
    for name, component in COMPONENTS.items():
        end = float(fit.best.reached[component])
        assert fit.result["moduli_error_range"][name] == [0.0, end]
        assert f"(strain 0 to {end:.3g})" in line.split(name)[1].split(",")[0]
        assert f"<td>0</td><td>{number(end)}</td></tr>" in page


def test_the_noise_that_is_given_makes_the_uncertainty(fitted, tmp_path: Path) -> None:
    fit, _ = fitted
    sigmas = []
    for noise in (0.02, 0.2):
        said = ("[bubble.match]", f"noise = {noise}\n[bubble.match]")
        project = read_project(small(tmp_path, said))
        setup = prepare_fit(project, [*project.tests.values()])
        problem = setup.problem()
        point = problem.evaluate(fit.best.point.unknowns, True, warm=False)
        sure = certainty(problem, point, fit.law, fit.best.valid)
        assert sure.noise == {"bubble": noise}
        assert problem.comparisons[0].objective.noise_is == "given"
        sigmas.append(sure.sigma["E1"])
    np.testing.assert_allclose(sigmas[1], 10 * sigmas[0], rtol=1e-6)


def test_the_residual_stands_beside_the_noise(fitted) -> None:
    fit, out = fitted
    (left,) = fit.result["misfit"].values()
    misfit = np.concatenate([fit.residuals()["difference"]])
    assert left["rms"] == pytest.approx(np.sqrt(np.mean(misfit**2)), rel=1e-6)
    assert (left["noise"], left["noise_is"], left["unit"]) == (0.05, "assumed", "mm")
    times = f"{left['rms'] / 0.05:.2g} times the noise (0.05 mm, assumed)"
    assert f"misfit of bubble: {left['rms']:.3g} mm RMS, {times}" in lines_of(fit, out)
    page = (out / "report.html").read_text()
    assert "Residual beside the noise" in page and f"<td>{number(left['rms'])}</td>" in page


def test_kinds_of_notes_are_no_closed_list() -> None:
    """A kind of another distribution is kept by name, also by copies from other processes."""
    kind = NoteKind("creep")
    note = pickle.loads(pickle.dumps(Note(kind, "the load fell by 3 %", "a strip")))
    assert note.kind == kind and kind.value == "creep" and kind not in list(NoteKind)
    assert rows([note]) == [{"of": "a strip", "kind": "creep", "note": "the load fell by 3 %"}]
    assert foremost([note, Note(NoteKind.MESH, "m")]) == "m" and marks([note]) == []
    with pytest.raises(ValueError, match="is not a valid NoteKind"):
        NoteKind(" ")
