"""materials/exports/subroutines.py: the UMAT, compiled and called as Abaqus would."""

import ctypes
import re

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.base import UnitsOptions
from bubblefit.materials.exports.subroutines import umat

from ...builders.fortran import (
    GONE,
    LAWS,
    SIZES,
    address,
    build,
    close,
    increments_everywhere,
    reals,
    strain_path,
)

XIT = """
      subroutine xit
      integer last
      common /asked/ last
      last = 1
      end
"""


def whole(*values):
    return np.array(values, dtype=np.int32)


def properties(export):
    text = export.files[".inp"]
    head, _, block = text.partition("*USER MATERIAL, CONSTANTS=")
    count, *lines = block.splitlines()
    assert count.endswith(", UNSYMM") and "*MATERIAL, NAME=" in head
    assert all(len(line.split(",")) <= 8 for line in lines)
    found = reals(*(float(v) for line in lines for v in line.split(",") if v.strip()))
    assert len(found) == int(count.split(",")[0]) == 4 + 5 * found[1:4].sum()
    return found


class UmatPoint:
    def __init__(self, umat_library, props):
        self.function, self.props = umat_library.umat_, props
        self.asked = ctypes.c_int32.in_dll(umat_library, "asked_")
        self.asked.value = 0
        self.strain, self.stress = np.zeros(3), np.zeros(3)
        self.ndi, self.ntens = 2, 3

    def call(self, increment, pnewdt=1.0):
        stress, stiffness = self.stress.copy(), np.full((3, 3), 77.0, order="F")
        energy, request, de = reals(0.0), reals(pnewdt), reals(*increment)
        empty = address(np.full(99, np.nan))
        ntens = whole(self.ntens)
        self.function(
            address(stress), empty, address(stiffness), address(energy), empty, empty, empty,
            empty, empty, empty, address(self.strain), address(de), empty, empty, empty, empty,
            empty, empty, ctypes.c_char_p(b"FABRIC".ljust(80)), address(whole(self.ndi)),
            address(whole(1)), address(ntens), address(whole(0)), address(self.props),
            address(whole(len(self.props))), empty, empty, address(request), empty, empty, empty,
            address(whole(3)), address(whole(2)), address(whole(1)), address(whole(1)),
            address(whole(1, 1, 1, 1)), address(whole(4)), ctypes.c_size_t(80),
        )  # fmt: skip
        return stress, stiffness, request[0], energy[0]

    def commit(self, increment):
        self.stress, stiffness, request, energy = self.call(increment)
        self.strain = self.strain + increment
        return self.stress, stiffness, request, energy


def exported(law):
    return umat(MaterialCard(law, 0.8, "Valmex 7318"), UnitsOptions())


@pytest.fixture(scope="module")
def umat_library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("umat")
    return build(folder, exported(LAWS["cubic"]).files[".f"], "-ffixed-form", beside=XIT)


@pytest.mark.parametrize("name", LAWS)
def test_umat_along_random_paths_has_stress_and_stiffness_of_the_python_law(umat_library, name):
    law, export = LAWS[name], exported(LAWS[name])
    props = properties(export)
    assert f"POISSON={0.5 if 'incompressible' in name else 0:g}\n" in export.files[".inp"]
    for seed in range(20):
        point = UmatPoint(umat_library, props)
        old, stress = np.zeros(3), np.zeros(3)
        for new in strain_path(seed):
            s, d, request, energy = point.commit(new - old)
            after, tangent = law.increment(old, new, stress)
            close(s, after[0])
            close(d, tangent[0])
            assert energy == pytest.approx(0.5 * (stress + after[0]) @ (new - old), rel=1e-9)
            assert request == 1.0
            old, stress = new, after[0]
        assert point.asked.value == 0


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("size", SIZES)
def test_umat_increments_of_any_size_from_any_state(umat_library, name, size):
    law, props = LAWS[name], properties(exported(LAWS[name]))
    for old, new in increments_everywhere(law, size):
        point = UmatPoint(umat_library, props)
        point.strain, point.stress = old, reals(3.0, -1.0, 0.5)
        s, d, request, _ = point.call(new - old)
        after, tangent = law.increment(old, new, point.stress)
        if np.isfinite(after).all():
            close(s, after[0])
            close(d, tangent[0])
        assert (request == 1.0) == np.isfinite(after).all()


def test_umat_asks_for_half_the_increment_where_a_modulus_runs_out(umat_library):
    point = UmatPoint(umat_library, properties(exported(GONE)))
    before = point.commit(reals(0.04, 0.0, 0.0))[0].copy()
    for increment in (reals(0.04, 0.0, 0.0), reals(np.nan, 0.0, 0.0)):
        stress, stiffness, request, _ = point.call(increment)
        assert request == 0.5 and np.array_equal(stress, before)
        assert (np.linalg.eigvalsh(stiffness) > 0).all()
        assert point.call(increment, pnewdt=0.1)[2] == 0.1


def test_umat_ends_the_job_for_other_than_plane_stress(umat_library):
    point = UmatPoint(umat_library, properties(exported(LAWS["cubic"])))
    point.ndi = 3
    point.call(np.zeros(3))
    assert point.asked.value == 1
    good = properties(exported(LAWS["spline"]))
    for other in (good[:-1], good[:4], np.append(good, 1.0), np.ones(22), 1e300 * good, -good):
        wrong = UmatPoint(umat_library, other)
        wrong.call(np.zeros(3))
        assert wrong.asked.value == 1
    right = UmatPoint(umat_library, good)
    right.call(np.zeros(3))
    assert right.asked.value == 0


def test_umat_names_and_lines_keep_the_limits_of_abaqus():
    card = MaterialCard(
        LAWS["cubic"], 0.8, "7318 – überzogen, very long indeed, and longer", "a\nb"
    )
    export = umat(card, UnitsOptions())
    (name,) = re.findall(r"\*MATERIAL, NAME=(.*)", export.files[".inp"])
    assert re.fullmatch(r"[A-Z]\w{0,31}", name)
    for text in export.files.values():
        assert text.isascii()
    for line in export.files[".f"].splitlines():
        assert len(line) <= 72 or (line[72:] == "&" and line[:6].strip() in ("", "&")), line
