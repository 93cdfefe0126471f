"""Arguments of public functions are checked against their annotations."""

import bubblefit as bf
import pytest
from bubblefit.errors import InputError, OutputError

from .support.refusals import raised


@pytest.fixture(scope="module")
def fit(one_strip_fit):
    return one_strip_fit


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("unit: expected one of 'GPa', 'MPa', 'Pa', got 'psi'",
         lambda fit, to: fit.card.write(to / "c.toml", unit="psi")),
        ("path: expected Path | str, got 3", lambda fit, to: fit.card.write(3)),
        ("folder: expected Path | str, got None", lambda fit, to: fit.report(None)),
        ("count: expected int of 0 or more, got -1", lambda fit, to: fit.draw_laws(-1)),
        ("count: expected int of 0 or more, got True", lambda fit, to: fit.draw_laws(True)),
        ("count: expected int of 0 or more, got 1.5", lambda fit, to: fit.draw_laws(1.5)),
        ("seed: expected int of 0 or more, got -1", lambda fit, to: fit.draw_laws(2, seed=-1)),
        ("starts: expected int of 1 or more, got True",
         lambda fit, to: bf.fit(fit.project, starts=True)),
        ("starts: expected int of 1 or more, got 0", lambda fit, to: bf.fit(fit.project, starts=0)),
        ("jobs: expected int of 1 or more, got True",
         lambda fit, to: bf.fit(fit.project, jobs=True)),
        ("seed: expected int of 0 or more, got -1", lambda fit, to: bf.fit(fit.project, seed=-1)),
        ("samples: expected int of 2 or more, got 1",
         lambda fit, to: bf.bootstrap(fit.project, "specimens", 1)),
        ("samples: expected int of 0 or more, got -1",
         lambda fit, to: bf.predict(fit.project, samples=-1)),
        ("folds: expected int of 2 or more, got 1",
         lambda fit, to: bf.compare(fit.project, folds=1)),
        ("starts: expected int of 1 or more, got -2",
         lambda fit, to: bf.validate(fit.project, starts=-2)),
        ("specimens: expected int of 1 or more, got 0",
         lambda fit, to: bf.plan(fit.project, specimens=0)),
        ("levels: expected int of 2 or more, got 1",
         lambda fit, to: bf.refine(fit.project, levels=1)),
        ("coarser: expected int of 0 or more, got -1",
         lambda fit, to: bf.refine(fit.project, coarser=-1)),
    ],
)  # fmt: skip
def test_argument_of_public_function_is_checked(words, call, fit, tmp_path):
    error = raised(InputError, None, call, fit, tmp_path)
    assert str(error) == words
    assert list(tmp_path.iterdir()) == []


def test_report_into_a_file_is_refused(fit, tmp_path):
    file = tmp_path / "a file"
    file.write_text("text")
    error = raised(OutputError, None, fit.report, file)
    assert str(error) == f"{file}: is a file; name a folder for the results"
    assert file.read_text() == "text"
