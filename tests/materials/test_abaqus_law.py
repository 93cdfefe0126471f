"""UMAT, compiled and called as Abaqus/Standard would, against the Python law point by point."""

import ctypes
import re

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.base import NoOptions
from bubblefit.materials.exports.subroutines import umat
from bubblefit.materials.law import HypoelasticLaw

from ..fortran_build import (
    LAWS,
    SIZES,
    address,
    build,
    close,
    increments_everywhere,
    reals,
    strain_path,
)

# What Abaqus has: a way to end the job.
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
    """The constants as Abaqus reads them from the input file."""
    text = export.files[".inp"]
    head, _, block = text.partition("*USER MATERIAL, CONSTANTS=")
    count, *lines = block.splitlines()
    assert count.endswith(", UNSYMM") and "*MATERIAL, NAME=" in head
    assert all(len(line.split(",")) <= 8 for line in lines)
    found = reals(*(float(v) for line in lines for v in line.split(",") if v.strip()))
    assert len(found) == int(count.split(",")[0]) == 4 + 5 * found[1:4].sum()
    return found


class Point:
    """One integration point, as Abaqus calls it."""

    def __init__(self, library, props):
        self.function, self.props = library.umat_, props
        self.asked = ctypes.c_int32.in_dll(library, "asked_")
        self.asked.value = 0
        self.strain, self.stress = np.zeros(3), np.zeros(3)
        self.ndi, self.ntens = 2, 3

    def call(self, increment, pnewdt=1.0):
        """Stress, stiffness and the share of the increment that is asked for."""
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
    return umat(MaterialCard(law, 0.8, "Valmex 7318"), NoOptions())


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """One for all cards: the constants come from the input file."""
    folder = tmp_path_factory.mktemp("umat")
    return build(folder, exported(LAWS["cubic"]).files[".f"], "-ffixed-form", beside=XIT)


@pytest.mark.parametrize("name", LAWS)
def test_random_paths_give_stress_and_stiffness_of_the_python_law(library, name):
    law, export = LAWS[name], exported(LAWS[name])
    props = properties(export)
    # Thickness is the section's business in Abaqus.
    assert f"POISSON={0.5 if 'incompressible' in name else 0:g}\n" in export.files[".inp"]
    for seed in range(20):
        point = Point(library, props)
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
def test_increments_of_any_size_from_anywhere(library, name, size):
    law, props = LAWS[name], properties(exported(LAWS[name]))
    for old, new in increments_everywhere(law, size):
        point = Point(library, props)
        point.strain, point.stress = old, reals(3.0, -1.0, 0.5)
        s, d, request, _ = point.call(new - old)
        after, tangent = law.increment(old, new, point.stress)
        if np.isfinite(after).all():
            close(s, after[0])
            close(d, tangent[0])
        assert (request == 1.0) == np.isfinite(after).all()


def test_free_form_is_the_same_subroutine(library, tmp_path):
    export = exported(LAWS["tri-linear"])
    free = build(tmp_path, export.files[".f"], "-ffree-form", beside=XIT)
    one, other = (Point(each, properties(export)) for each in (library, free))
    for increment in np.diff(strain_path(5), axis=0, prepend=0):
        for a, b in zip(one.commit(increment), other.commit(increment), strict=True):
            assert np.array_equal(a, b)


def test_a_modulus_that_runs_out_asks_for_half_the_increment(library):
    # E1 is gone at 5 % strain.
    law = HypoelasticLaw(np.r_[0, 0, 0, 20.0, 0, 0, 0, 100.0, 0, 0, -1e4, 500.0])
    point = Point(library, properties(exported(law)))
    before = point.commit(reals(0.04, 0.0, 0.0))[0].copy()
    for increment in (reals(0.04, 0.0, 0.0), reals(np.nan, 0.0, 0.0)):
        stress, stiffness, request, _ = point.call(increment)
        assert request == 0.5 and np.array_equal(stress, before)
        assert (np.linalg.eigvalsh(stiffness) > 0).all()
        # Another point's smaller request stays.
        assert point.call(increment, pnewdt=0.1)[2] == 0.1


def test_what_is_no_plane_stress_ends_the_job(library):
    point = Point(library, properties(exported(LAWS["cubic"])))
    point.ndi = 3
    point.call(np.zeros(3))
    assert point.asked.value == 1
    good = properties(exported(LAWS["spline"]))
    for other in (good[:-1], good[:4], np.append(good, 1.0), np.ones(22), 1e300 * good, -good):
        wrong = Point(library, other)
        wrong.call(np.zeros(3))
        assert wrong.asked.value == 1
    right = Point(library, good)
    right.call(np.zeros(3))
    assert right.asked.value == 0


def test_the_names_and_lines_are_ones_that_abaqus_takes():
    card = MaterialCard(
        LAWS["cubic"], 0.8, "7318 – überzogen, very long indeed, and longer", "a\nb"
    )
    export = umat(card, NoOptions())
    (name,) = re.findall(r"\*MATERIAL, NAME=(.*)", export.files[".inp"])
    assert re.fullmatch(r"[A-Z]\w{0,31}", name)
    for text in export.files.values():
        assert text.isascii()
    for line in export.files[".f"].splitlines():
        assert len(line) <= 72 or (line[72:] == "&" and line[:6].strip() in ("", "&")), line
