"""materials/exports/subroutines.py: HYPELA2, compiled and called as Marc would."""

import ctypes

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.base import UnitsOptions
from bubblefit.materials.exports.subroutines import hypela2, hypela2_source

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
from ...marc_stand_in.laws import QUIT

COUNTS = {"membrane": (3, 1), "thick shell": (5, 3)}  # ngens, nshear


class Hypela2Point:
    def __init__(self, library, element="membrane", integer=np.int32, number=1, own_state=True):
        self.function, self.integer, self.number = library.hypela2_, integer, number
        self.own_state = own_state
        self.asked = (ctypes.c_int64 if integer is np.int64 else ctypes.c_int32).in_dll(
            library, "asked_"
        )
        self.asked.value = 0
        self.ngens, self.nshear = COUNTS[element]
        self.ndi = 2
        self.states = reals(20.0, *np.zeros(3 + self.ngens))
        self.strain, self.stress = np.zeros(self.ngens), np.zeros(self.ngens)

    def call(self, increment):
        """Stress, D and state at the end; the arguments that are not for shells are NaN."""
        n = self.ngens
        d, g = np.full((n, n), 77.0, order="F"), np.full(n, 77.0)
        # What lies behind an array is somebody else's.
        s, t = np.append(self.stress, [77.0] * 9), np.append(self.states, [77.0] * 9)
        # With own states the subroutine must not look at what Marc says of e and s.
        e = np.full(n, np.nan) if self.own_state else self.strain
        if self.own_state:
            s[:n] = np.nan
        else:
            t[1:-9] = np.nan
        nothing, de = np.full(99, np.nan), reals(*increment)
        empty = address(nothing)
        whole = [np.array(v, dtype=self.integer) for v in (
            n, [3, 3], 2, [1, 1], [self.number, 1], self.ndi, self.nshear,
            3, 3, 6, 2, 4, 75, [1, 1], 0, 0,
        )]  # fmt: skip
        (ngens, m, nn, kcus, matus, ndi, nshear, ncrd, itel, ndeg, ndm, nnode, jtype, lclass,
         ifr, ifu) = map(address, whole)  # fmt: skip
        self.function(
            address(d), address(g), address(e), address(de), address(s), address(t), empty,
            ngens, m, nn, kcus, matus, ndi, nshear, empty, empty, empty, empty, empty, empty,
            empty, empty, empty, empty, empty, ncrd, itel, ndeg, ndm, nnode, jtype, lclass,
            ifr, ifu,
        )  # fmt: skip
        assert (s[n:] == 77.0).all() and (t[-9:] == 77.0).all()
        return s[:n], d, g, t[:-9]

    def commit(self, increment):
        s, d, _, t = self.call(increment)
        self.stress, self.states = s, t
        self.strain = self.strain + increment
        return s, d


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("hypela2"), {}

    def library(name, form="-ffixed-form", **options):
        key = (name, form, *sorted(options.items()))
        if key not in made:
            source = hypela2_source({1: LAWS[name]}, **options)
            made[key] = build(folder / str(len(made)), source, form, beside=QUIT)
        return made[key]

    return library


def expected_response(law, old, new, stress):
    """Cauchy stress, what Marc is given of it, and D: with the thickness that Marc keeps."""
    after, tangent = law.increment(old, new, stress)
    after, tangent = after[0], tangent[0]
    thin = np.exp((law.area_power - 1) * (new[0] + new[1]))
    tangent[:, :2] += (law.area_power - 1) * after[:, None]
    return after, thin * after, thin * tangent


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("own_state", [True, False])
def test_hypela2_along_random_paths_has_stress_and_stiffness_of_the_python_law(
    libraries, name, own_state
):
    law, library = LAWS[name], libraries(name, own_state=own_state)
    held = passed = 0
    for seed in range(20):
        point = Hypela2Point(library, own_state=own_state)
        old, stress = np.zeros(3), np.zeros(3)
        for new in strain_path(seed):
            s, d = point.commit(new - old)
            stress, wanted, tangent = expected_response(law, old, new, stress)
            close(s, wanted)
            close(d, 0.5 * (tangent + tangent.T))
            if own_state:
                close(point.states[1:4], new)
                close(point.states[4:7], stress)
            held += (np.abs(new) > law.strain_range).any()
            passed += (new[:2] < 0).any()
            old = new
        assert point.asked.value == 0 and point.states[0] == 20.0
    # Otherwise the comparison would say nothing of what is outside the range.
    assert passed > 10
    assert held > 10 or "held" not in name


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("size", SIZES)
def test_hypela2_increments_of_any_size_from_any_state(libraries, name, size):
    law, stress = LAWS[name], reals(3.0, -1.0, 0.5)
    for old, new in increments_everywhere(law, size):
        point = Hypela2Point(libraries(name, own_state=True))
        point.states[1:] = *old, *stress
        s, d, _, _ = point.call(new - old)
        _, wanted, tangent = expected_response(law, old, new, stress)
        if np.isfinite(wanted).all():
            close(s, wanted)
            close(d, 0.5 * (tangent + tangent.T))
        else:
            assert point.asked.value == 4001


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
def test_hypela2_full_tangent_is_derivative_of_the_stress(libraries, name):
    point = Hypela2Point(libraries(name, symmetric=False))
    first, second = strain_path(3, 2)
    point.commit(first)
    increment = second - first
    _, d, _, _ = point.call(increment)
    slope, step = np.empty((3, 3)), 1e-6
    for j in range(3):
        change = step * np.eye(3)[j]
        slope[:, j] = (point.call(increment + change)[0] - point.call(increment - change)[0]) / (
            2 * step
        )
    close(d, slope, 1e-7)


def test_hypela2_keeps_no_state_between_calls(libraries):
    point = Hypela2Point(libraries("cubic"))
    point.commit(reals(0.02, 0.01, -0.03))
    first, _, _, state = point.call(reals(0.01, 0.0, 0.02))
    point.call(reals(0.05, 0.02, -0.02))
    again, _, _, same = point.call(reals(0.01, 0.0, 0.02))
    assert np.array_equal(first, again) and np.array_equal(state, same)


def test_hypela2_thick_shells_have_linear_transverse_shear(libraries):
    law, plane = LAWS["cubic"], Hypela2Point(libraries("cubic"))
    point = Hypela2Point(libraries("cubic"), "thick shell")
    for increment in np.diff(strain_path(1), axis=0, prepend=0):
        s, d = point.commit(reals(*increment, 0.001, -0.002))
        flat, stiffness = plane.commit(increment)
        assert np.array_equal(s[:3], flat) and np.array_equal(d[:3, :3], stiffness)
        assert not d[3:, :3].any() and not d[:3, 3:].any()
        close(d[3:, 3:], law.G12(0.0) * np.eye(2))
    close(s[3:], law.G12(0.0) * 9 * reals(0.001, -0.002))
    assert not point.call(np.zeros(5))[2].any()


def test_hypela2_wide_integers_free_form_and_material_numbers(tmp_path, libraries):
    law, new = LAWS["cubic"], reals(0.02, 0.01, 0.03)
    options = ("-ffixed-form", "-fdefault-integer-8")
    library = build(tmp_path / "wide", hypela2_source({1: law}), *options, beside=QUIT)
    point = Hypela2Point(library, integer=np.int64)
    close(point.commit(new)[0], law.increment(np.zeros(3), new, np.zeros(3))[0][0])
    assert point.asked.value == 0
    fixed, free = (
        Hypela2Point(libraries("tri-linear", f"-f{form}-form")) for form in ("fixed", "free")
    )
    for increment in np.diff(strain_path(5), axis=0, prepend=0):
        for one, other in zip(fixed.commit(increment), free.commit(increment), strict=True):
            assert np.array_equal(one, other)
    source = hypela2_source({3: LAWS["cubic"], 7: LAWS["tri-linear"]})
    library = build(tmp_path / "two", source, "-ffixed-form", beside=QUIT)
    for number, name in ((3, "cubic"), (7, "tri-linear")):
        s, _ = Hypela2Point(library, number=number).commit(new)
        close(s, LAWS[name].increment(np.zeros(3), new, np.zeros(3))[0][0])
    stranger = Hypela2Point(library, number=4)
    s, *_ = stranger.call(new)
    assert stranger.asked.value == 4003 and np.isnan(s).all()
    text = hypela2(MaterialCard(LAWS["tri-linear"], 0.5, "n" * 200, "s" * 300), UnitsOptions())
    for line in text.files[".f"].splitlines():
        # Column 73 marks what the next line continues in free form; fixed form does not see it.
        assert len(line) <= 72 or (line[72:] == "&" and line[:6].strip() in ("", "&")), line
        assert line.isascii()


def test_hypela2_ends_the_job_outside_of_the_law(tmp_path, libraries):
    solid = Hypela2Point(libraries("cubic"))
    solid.ndi = 3
    solid.call(np.zeros(3))
    assert solid.asked.value == 4002
    source = hypela2_source({1: GONE})
    assert "No stresses to check against" in source
    library = build(tmp_path, source, "-ffixed-form", beside=QUIT)
    point = Hypela2Point(library)
    point.commit(reals(0.04, 0.0, 0.0))
    assert point.asked.value == 0
    for one, strain in ((point, 0.04), (Hypela2Point(library), np.nan)):
        one.call(reals(strain, 0.0, 0.0))
        assert one.asked.value == 4001


@pytest.mark.parametrize("name", ["cubic", "incompressible"])
def test_hypela2_heading_states_the_answers_of_the_subroutine(tmp_path, name):
    text = hypela2(MaterialCard(LAWS[name], 0.5, "Valmex"), UnitsOptions()).files[".f"]
    library = build(tmp_path, text, "-ffixed-form", beside=QUIT)
    point = Hypela2Point(library)
    old, across = 0.0, 0.0
    for end in np.log1p(0.1 * np.arange(1, 101) / 100):
        width = 0.0
        for _ in range(30):
            s, d, _, _ = point.call(reals(end - old, width, 0.0))
            width -= s[1] / d[1, 1]
        s, _ = point.commit(reals(end - old, width, 0.0))
        old, across = end, across + width
    assert abs(s[1]) < 1e-9 and across < 0
    assert f"must be {s[0]:.4f} MPa" in text
    s, _ = Hypela2Point(library).commit(reals(0.0, 0.0, 0.01))
    assert f"tau12 = {s[2]:.6f} MPa" in text
