"""examples/deck-picture-frame: a deck of one's own with the law of a bias strip."""

import shutil

import numpy as np
import pytest
from bubblefit.materials.card import read_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.solvers.calculix.solver import CalculixSolver

from ..support import needs
from ..support.commands import in_process
from ..support.paths import EXAMPLES

EXAMPLE = EXAMPLES / "deck-picture-frame"
#: mm: side of the frame, and thickness of the sheet.
SIDE = 145.0
THICKNESS = 0.8


@pytest.fixture
def coarse(tmp_path):
    """The example with 4 elements, 5 increments and constant moduli."""
    needs.calculix()
    folder = tmp_path / "frame"
    shutil.copytree(EXAMPLE, folder)
    replaced = {"set n = 6": "set n = 2", "0.1, 1.": "0.2, 1.", '"linear"': '"constant"'}
    for name in ("frame.inp.j2", "frame.toml"):
        text = (folder / name).read_text()
        for old, new in replaced.items():
            text = text.replace(old, new)
        (folder / name).write_text(text)
    return folder


def test_force_of_the_frame_is_the_work_of_shear(coarse):
    model = read_project(coarse / "frame.toml").tests["frame"].model
    history = CalculixSolver().run(model.deck(law := HypoelasticLaw.linear(0.1, 0.1, 12.0)), law)
    travel = model.reader.readings[0].at

    def angle(travel):
        return 2 * np.arcsin((SIDE / 2**0.5 + travel / 2) / SIDE) - np.pi / 2

    # Mean force between two readings by the work of 12 MPa times the mean shear.
    energy = 0.5 * 12.0 * angle(travel) ** 2 * THICKNESS * SIDE**2
    force = 0.5 * (history.load[1:] + history.load[:-1])
    np.testing.assert_allclose(force, np.diff(energy) / np.diff(travel), rtol=0.01)
    shear = angle(travel[-1])
    np.testing.assert_allclose(history.strain_max, [0, 0, shear], atol=3e-4)


def test_fit_of_the_frame_alone_finds_the_shear_modulus(coarse):
    project = coarse / "frame.toml"
    text = project.read_text()
    for name, bounds in (("E1", "[575.0, 576.0]"), ("E2", "[260.0, 261.0]")):
        text = text.replace(f"{name} = [100.0, 3000.0]", f"{name} = {bounds}")
    project.write_text(text)
    template = coarse / "frame.inp.j2"
    template.write_text(template.read_text().replace("0.2, 1.", "0.5, 1."))
    in_process("fit", project, "--test", "frame", "--out", "out", "--quiet", cwd=coarse)
    law = read_card(coarse / "out" / "material.toml").law
    # One modulus in place of 12 to 9 MPa.
    assert float(law.G12(0.05)) == pytest.approx(10.5, abs=0.4)
