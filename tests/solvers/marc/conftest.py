"""Fixtures of the tests with Marc: decks read by the stand-in, a fake program."""

import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...marc_stand_in.deck import read_deck
from .cases import write_run_files


@pytest.fixture(scope="session")
def read_by_stand_in(tmp_path_factory):
    path = tmp_path_factory.mktemp("decks") / "job.dat"

    def content(text, reader=read_deck):
        path.write_text(text)
        return reader(path)

    return content


@pytest.fixture(scope="module")
def tube_model():
    return inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 60.0, 100.0])


@pytest.fixture(scope="module")
def inflated_points(tube_model):
    return tube_model.mesh.points * [0.05, 0.05, 0.0]


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


@pytest.fixture
def fake_machine(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")
    return tmp_path


@pytest.fixture
def fake_marc(fake_machine):
    def make(script, **options):
        path = fake_machine / "run_marc"
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        (fake_machine / "scratch").mkdir(exist_ok=True)
        return solver_named("marc", marc=path, scratch=str(fake_machine / "scratch"), **options)

    return make


@pytest.fixture
def complete_run(fake_machine):
    history = MembraneSolver().run(model(), LAW)
    return write_run_files(fake_machine / "good", model(), history), history


@pytest.fixture(autouse=True)
def no_site(monkeypatch):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
