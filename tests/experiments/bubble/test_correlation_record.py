"""How displacements were measured, as a project says it and as the page's record shows it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import pytest
from bubblefit.experiments.bubble.findings import ASKED, correlation_table
from bubblefit.experiments.bubble.point_files import PointFiles
from bubblefit.experiments.bubble.section import CorrelationSection
from bubblefit.meshes.reading import Facet

from ...complaints import complaint

PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.2, 1.5]
E2 = [0.2, 1.5]
G12 = [0.02, 0.3]
[[bubble]]
radius = 100.0
pressures = [30]
[bubble.data.points]
files = ["a.csv"]
[bubble.data.points.correlation]
"""


def read(folder, more: str) -> bf.Project:
    path = folder / "project.toml"
    path.write_text(PROJECT + more)
    (folder / "a.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    return bf.read_project(path)


def shown(correlation: dict[str, str], facet: Facet | None = None, **more: Any) -> dict[str, str]:
    test = SimpleNamespace(
        name="one", data=PointFiles((), None, correlation=correlation), facet=facet,  # type: ignore[arg-type]
        **({"noise": None, "match_by": "points", "match_degree": 4} | more),
    )  # fmt: skip
    field = SimpleNamespace(source=SimpleNamespace(format="matchid"), points=range(7))
    prepared: Any = SimpleNamespace(test=test, fields=[field], dropped=2, registration=None)
    (table,) = correlation_table(prepared)
    assert table.title == "Image correlation: one"
    rows = {str(name): str(words) for name, words in table.rows}
    assert len(rows) == len(table.rows)
    return rows


def test_what_is_not_given_is_said_to_be_not_given() -> None:
    rows = shown({})
    assert [name for name, words in rows.items() if words == "not given"] == [
        "noise floor of a displacement", *ASKED.values()
    ]  # fmt: skip
    assert rows["software and format of the export"] == "matchid"
    assert rows["points in an image"] == "7 to 7" and rows["points left out as doubtful"] == "2"
    assert shown({}, noise=0.0123)["noise floor of a displacement"] == "0.0123 mm"
    surfaces = shown({}, match_by="surfaces")
    assert surfaces["smoothing"] == "polynomial surfaces of degree 4"


def test_every_key_of_the_section_stands_on_the_page(tmp_path) -> None:
    keys = list(CorrelationSection.model_fields)
    assert set(keys) == {"software", *ASKED}
    said = {key: f"the {key}, 3 mm" for key in keys}
    project = read(tmp_path, "".join(f'{key} = "{words}"\n' for key, words in said.items()))
    (test,) = project.tests.values()
    assert test.data.correlation == said  # type: ignore[attr-defined]
    rows = shown(test.data.correlation)  # type: ignore[attr-defined]
    assert {key: rows[name] for key, name in ASKED.items()} == {key: said[key] for key in ASKED}
    assert rows["software and format of the export"] == "the software, 3 mm; matchid"


def test_the_filter_tells_subset_and_step_where_nobody_else_does() -> None:
    facet = Facet(4.0, 1, 3, 1.5)
    rows = shown({}, facet)
    assert (rows["subset size"], rows["step size"]) == ("4 mm", "1.5 mm")
    rows = shown({"subset": "19 pixels"}, facet)
    assert (rows["subset size"], rows["step size"]) == ("19 pixels", "1.5 mm")
    assert shown({}, Facet(4.0))["step size"] == "not given"


def test_words_change_no_result(tmp_path) -> None:
    """A fit that is told of its lens afterwards can go on."""
    one, other = (
        next(iter(read(tmp_path, more).tests.values())).settings()
        for more in ("", 'lens = "35 mm, f/8"\n')
    )
    assert one == other


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('lense = "35 mm"\n', ["lense"]),
        ("lens = 35\n", ["lens"]),
        ('lens = ""\n', ["lens"]),
        ('lens = "35 mm\\nf/8"\n', ["lens"]),
        (f'lens = "{301 * "m"}"\n', ["lens"]),
    ],
)
def test_bad_words_are_named(tmp_path, more: str, words: list[str]) -> None:
    said = complaint(read, tmp_path, more)
    assert all(w in said for w in ["bubble[0].data.points.correlation", *words]), said
    assert "\n" not in said
