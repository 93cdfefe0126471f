"""Starts that an earlier fit proposes: of the same law and tests, or a line that says why not."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.inference.unknowns import ProposedStarts, SobolStarts
from bubblefit.runs.setup import proposals

from ..commands import in_process
from ..complaints import complaint
from ..projects import constant_strips


@pytest.fixture(scope="module")
def earlier(strips_project: bf.Project, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a fit of two starts."""
    folder = tmp_path_factory.mktemp("earlier") / "out"
    bf.fit(strips_project, jobs=1, starts=2, out=folder)
    return folder


def objectives_at_first(folder: Path) -> list[float]:
    rows = [row.split(",") for row in (folder / "history.csv").read_text().splitlines()[1:]]
    return [float(row[4]) for row in rows if row[1] == "1"]


def test_proposed_starts_begin_lower(
    strips_project: bf.Project, earlier: Path, tmp_path: Path
) -> None:
    found = bf.fit(
        strips_project, jobs=1, starts=2, seed=9, starts_from="proposed", earlier=earlier,
        out=tmp_path / "out",
    )  # fmt: skip
    assert isinstance(found.setup.starts, ProposedStarts)
    assert (
        len(found.setup.starts.objectives)
        == len((earlier / "history.csv").read_text().splitlines()) - 1
    )
    assert max(objectives_at_first(tmp_path / "out")) < min(objectives_at_first(earlier))
    # Another history proposes other starts: it is not gone on with.
    changed = tmp_path / "changed"
    shutil.copytree(earlier, changed)
    lines = (changed / "history.csv").read_text().splitlines(True)
    (changed / "history.csv").write_text("".join(lines[:-1]))
    said = complaint(
        bf.fit, strips_project, jobs=1, starts=2, seed=9, starts_from="proposed", earlier=changed,
        out=tmp_path / "out", resume=True,
    )  # fmt: skip
    assert "earlier evaluations" in said


def test_coefficients_come_in_mpa(strips_project: bf.Project, earlier: Path) -> None:
    found = bf.fit(strips_project, jobs=1, starts=1, starts_from="proposed", earlier=earlier)
    assert isinstance(found.setup.starts, ProposedStarts)
    best = found.setup.starts.coefficients[np.argmin(found.setup.starts.objectives)]
    # G12 is not determined by strips along the yarns.
    own = found.law.beta[found.law.beta != 0]
    np.testing.assert_allclose(best[1:], own[1:], rtol=1e-3)


def test_another_model_is_refused(earlier: Path, tmp_path: Path) -> None:
    project = bf.read_project(constant_strips(tmp_path, ('form = "constant"', 'form = "linear"')))
    said = complaint(bf.fit, project, jobs=1, starts_from="proposed", earlier=earlier)
    assert said.startswith(
        f"{earlier}: fit.earlier (or --earlier): is a fit of another model: its "
    )
    assert "law" in said


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("run.json", None, "expected the folder of a fit, with run.json and history.csv"),
        ("run.json", "[]", "expected the folder of a fit"),
        ("history.csv", None, "expected the folder of a fit"),
        ("history.csv", "start,analysis,solver,mesh,objective,status\n", "has not the columns"),
    ],
)
def test_what_is_no_fit_is_refused(
    strips_project: bf.Project, earlier: Path, tmp_path: Path, name: str, text: str | None,
    words: str,
) -> None:  # fmt: skip
    folder = tmp_path / "broken"
    shutil.copytree(earlier, folder)
    (folder / name).unlink()
    if text is not None:
        (folder / name).write_text(text)
    assert words in complaint(
        bf.fit, strips_project, jobs=1, starts_from="proposed", earlier=folder
    )


def test_damaged_and_failed_rows(earlier: Path, tmp_path: Path) -> None:
    parts = json.loads((earlier / "run.json").read_text())["parts"]
    head, *rows = (earlier / "history.csv").read_text().splitlines()
    columns = head.split(",")[6:]
    folder = tmp_path / "some"
    shutil.copytree(earlier, folder)

    def taken(*lines: str) -> ProposedStarts:
        (folder / "history.csv").write_text("\n".join([head, *lines]) + "\n")
        return proposals(folder, parts, columns, 1000.0)

    failed = rows[0].split(",")
    failed[4] = ""
    assert len(taken(rows[1], ",".join(failed), "0,3,membr").objectives) == 1
    assert "no evaluation that ended well" in complaint(taken, ",".join(failed))
    odd = rows[0].split(",")
    odd[-1] = "many"
    assert "is damaged" in complaint(taken, ",".join(odd))


def test_where_starts_begin_is_a_matter_of_the_project(tmp_path: Path, earlier: Path) -> None:
    sobol = ("starts = 2", 'starts = 2\nstarts_from = "sobol"')
    project = bf.read_project(constant_strips(tmp_path, sobol))
    assert project.fit.starts_from == "sobol"
    assert isinstance(bf.fit(project, jobs=1, starts=1).setup.starts, SobolStarts)
    said = complaint(bf.fit, project, jobs=1, earlier=earlier)
    assert "fit.earlier (or --earlier): means something with" in said
    said = complaint(bf.fit, project, jobs=1, starts_from="proposed")
    assert "name the folder of an earlier fit of this project" in said


def test_the_command_takes_them(strips_project: bf.Project, earlier: Path, tmp_path: Path) -> None:
    done = in_process(
        "fit", strips_project.path, "--starts", 1, "--starts-from", "proposed", "--earlier",
        tmp_path / "nothing", "--out", "out", cwd=tmp_path, code=2,
    )  # fmt: skip
    assert f"{tmp_path / 'nothing'}: fit.earlier (or --earlier): expected the folder" in done.stderr
