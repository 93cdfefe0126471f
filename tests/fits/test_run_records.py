"""Runs with cards as they are stored: exactly, each under a mark of all that it depends on."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.experiments.cylinder.predicted import CylinderPredicted, run_of
from bubblefit.experiments.kinds import RunRecord
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, curve_reading, inflated_cylinder
from bubblefit.notes import Note, NoteKind
from bubblefit.runs.folder import RunRecords
from bubblefit.runs.predictions import mark_of
from bubblefit.solvers.base import History
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.registry import solver_named
from bubblefit.solvers.run_cache import digest_of

from ..cylinder_cases import FAILS, STOPS, Formula, ran

WAY = np.linspace(0.0, 240.0, 61)
KIND = CylinderPredicted()


def law(e1: float = 500.0) -> HypoelasticLaw:
    return HypoelasticLaw.linear(e1, 150.0, 20.0)


def model(symmetry: str = "quarter") -> CylinderModel:
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


def card(e1: float = 500.0) -> MaterialCard:
    return MaterialCard(law(e1), 0.81)


def test_a_run_is_stored_exactly(tmp_path: Path) -> None:
    record = ran(model(), card())
    folder = RunRecords(tmp_path / "out")
    folder.begin(False, False)
    folder.write("a" * 64, record)
    again = folder.read("a" * 64)
    for field in fields(record):
        one, other = getattr(again, field.name), getattr(record, field.name)
        if field.name == "arrays":
            assert list(one) == list(other)
            for name in other:
                np.testing.assert_array_equal(one[name], other[name])
        else:
            np.testing.assert_array_equal(one, other)
    assert folder.read("b" * 64) is None
    with pytest.raises(OutputError, match="--resume"):
        folder.begin(False, False)
    folder.begin(True, False)
    assert folder.read("a" * 64) is not None
    folder.begin(False, True)
    assert folder.read("a" * 64) is None


@pytest.mark.parametrize("resume", [True, False])
def test_a_file_whose_writing_was_cut_off_goes(tmp_path: Path, resume: bool) -> None:
    folder = RunRecords(tmp_path)
    folder.begin(False, False)
    folder.write("a" * 64, ran(model(), card()))
    (tmp_path / "runs" / ".aaaa.123.npz").write_bytes(b"half")
    folder.begin(resume, not resume)
    assert len(list((tmp_path / "runs").iterdir())) == resume
    assert (folder.read("a" * 64) is not None) == resume


def test_runs_of_an_earlier_version_are_found_by_their_names(tmp_path: Path) -> None:
    """The first twenty digits of the mark: under another name nothing would be gone on with."""
    folder = RunRecords(tmp_path)
    folder.begin(False, False)
    folder.write("0123456789abcdef" * 4, ran(model(), card()))
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["0123456789abcdef0123.npz"]


def test_there_is_nothing_to_go_on_with_where_nothing_was(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to go on with"):
        RunRecords(tmp_path / "out").begin(True, False)


@pytest.mark.parametrize("damage", ["cut", "text", "pickle", "other", "empty"])
def test_a_damaged_file_is_no_run(tmp_path: Path, damage: str) -> None:
    folder = RunRecords(tmp_path)
    folder.begin(False, False)
    folder.write("a" * 64, ran(model(), card()))
    (path,) = (tmp_path / "runs").glob("*.npz")
    content = path.read_bytes()
    if damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "text":
        path.write_text("not an archive")
    elif damage == "pickle":
        np.savez(path, words=np.array([{"seconds": 1}], dtype=object))
    elif damage == "other":
        np.savez(path, words=np.array("{}"))
    else:
        path.write_bytes(b"")
    assert folder.read("a" * 64) is None


def test_runs_that_fail_or_stop_early(tmp_path: Path) -> None:
    failed = ran(model(), card(FAILS))
    assert failed.failure == "made to fail" and not failed.arrays and run_of(failed) is None
    folder = RunRecords(tmp_path)
    folder.begin(False, False)
    folder.write("a" * 64, failed)  # it gets another chance
    assert folder.read("a" * 64) is None
    stopped = run_of(ran(model(), card(STOPS)))
    assert stopped is not None and stopped.deflection[-1] == 120.0


def test_results_that_end_without_a_word_are_a_failure() -> None:
    class Silent(Formula):
        def run(self, *arguments, **named) -> History:
            return replace(super().run(*arguments, **named), early="")

    record = ran(model(), card(STOPS), Silent())
    assert record.failure == "the results end at 120 of 240 mm, and do not say why"
    assert not record.early and not record.arrays


def test_the_mark_is_of_everything_that_matters() -> None:
    m = model()

    class Other(Formula):
        name = "calculix"

        def __init__(self) -> None:
            self.identity = "calculix 2.21"

    usual, formula = law(), Formula()

    def mark(m=m, law=usual, solver=formula) -> str:
        return mark_of(KIND, m, law, solver)

    others = {
        mark(law=law(501.0)),
        mark(law=replace(usual, nu12=0.3)),
        mark(law=replace(usual, thickness_change="incompressible")),
        mark(m=replace(m, thickness=2 * m.thickness)),
        mark(m=replace(m, deflections=m.deflections[:-1], increments=())),
        mark(m=replace(m, inflation=(0.1, 0.14))),
        mark(m=replace(m, collar=replace(m.collar, fillet=3.0))),
        mark(m=replace(m, gas=replace(m.gas, ambient=0.09))),
        mark(m=model("full")),
        mark(solver=Other()),
        mark(solver=Formula(accuracy=2)),
    }
    assert mark() not in others and len(others) == 11
    # Where a curve is read changes no result, and the same model is the same made again.
    assert mark() == mark(m=replace(m, reading=curve_reading(150.0, [5.0]))) == mark(m=model())


def test_a_strain_range_that_cuts_nothing_else_is_part_of_it() -> None:
    cubic = HypoelasticLaw([0, 0, 1, 20, 0, 0, 1, 150, 0, 0, 1, 500], 0.24, [0.2, 0.2, 0.2])
    ends = [np.array([0.2, 0.2, 0.2]), np.array([0.2, 0.2, 0.1]), np.array([0.1, 0.2, 0.2])]
    marks = {mark_of(KIND, model(), replace(cubic, strain_range=e), Formula()) for e in ends}
    assert len(marks) == 3


def test_the_solver_s_options_are_part_of_it(tmp_path: Path) -> None:
    def mark(**options: object) -> str:
        return mark_of(KIND, model(), law(), solver_named("membrane", **options))

    assert mark() == mark()
    assert mark(wrinkle_stiffness=0.002) != mark()
    # What a cylinder is predicted with unless told otherwise has one mark, however it is asked for.
    assert mark(wall="tension field") == mark() != mark(wall="stiff")
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING")
    options = ({}, {"threads": 2}, {"templates": tmp_path})
    words = [CalculixSolver(ccx="ccx", **o).identity for o in options]
    assert words[0] == words[1] != words[2]
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING\nanother")
    assert CalculixSolver(ccx="ccx", templates=tmp_path).identity not in words


def test_digests_tell_things_apart_by_what_they_hold() -> None:
    things = [
        1, 1.0, True, "1", None, [1], [1, 2], [[1], 2], [1, [2]], {"a": 1}, {"a": 2}, {"b": 1},
        np.array([1.0]), np.array([[1.0]]), np.array([1]), ["ab", "c"], ["a", "bc"],
    ]  # fmt: skip
    assert len({digest_of(thing) for thing in things}) == len(things)
    assert digest_of({"a": 1, "b": 2}) == digest_of({"b": 2, "a": 1})
    with pytest.raises(TypeError, match="object"):
        digest_of(object())


def test_of_what_a_remark_is_said_comes_back(tmp_path: Path) -> None:
    records = RunRecords(tmp_path)
    records.begin(False, False)
    said = Note(NoteKind.SNAP, "it snapped", "at 3 kPa")
    records.write("a" * 64, RunRecord(1.0, strain=np.ones(3), remarks=(said,), from_cache=True))
    found = records.read("a" * 64)
    assert found is not None and found.from_cache
    assert [(note.kind, note, note.of) for note in found.remarks] == [(said.kind, said, said.of)]
