"""solvers/calculix/library.py: the material library against the Python law, alone and in ccx."""

import ctypes
import math
import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import OutputError, SolverFailure
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.forms.ratio import SplineCrimp, SplineRatio
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.calculix import library
from bubblefit.solvers.calculix.library import (
    SOURCE,
    STATE_VARIABLES,
    constants,
    law_files,
    law_number,
    law_text,
    material_library,
)

from ...builders.fortran import BETA, GONE, LAWS, SIZES, increments_everywhere, spline
from ...materials.cases import export
from ...support import needs
from ...support.refusals import raised


@pytest.mark.parametrize("name", ["cubic", "tri-linear, held"])
def test_exported_calculix_files_hold_constants_and_source(name):
    files, wanted = export("calculix", MaterialCard(LAWS[name], 0.8)).files, constants(LAWS[name])
    _, _, tail = files[".inp"].partition("*USER MATERIAL, CONSTANTS=")
    count, *rows = tail.partition("*DEPVAR")[0].splitlines()
    found = [v for row in rows for v in row.split(",") if v.strip()]
    assert all(len(v.strip()) <= 20 for v in found)
    assert int(count) == len(wanted)
    assert [float(v) for v in found] == pytest.approx(wanted, rel=1e-12)
    assert (files[".c"], files[".law"]) == (SOURCE.read_text(), law_text(LAWS[name]))


def test_ccx_runs_the_exported_card(ccx, tmp_path, monkeypatch):
    files = export("calculix").files
    for name, suffix in (("FILE.c", ".c"), ("card.inp", ".inp"), ("any name.law", ".law")):
        (tmp_path / name).write_text(files[suffix])
    (line,) = [text for text in files[".inp"].splitlines() if text.startswith("**   cc ")]
    command = line.removeprefix("**   cc ").split()
    subprocess.run([*needs.c_compiler(), *command], cwd=tmp_path, check=True)
    gradient, increments = np.eye(3), 10
    gradient[:2, :2] = [[1.06, 0.03], [0.05, 1.04]]
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    deck = patch_deck("S8R", LAWS["cubic"], gradient, increments, 0.0, "")
    start, stop = deck.index("*MATERIAL"), deck.index("*SHELL SECTION")
    deck = f"{deck[:start]}*INCLUDE, INPUT=card.inp\n{deck[stop:]}"
    check_patch(ccx, tmp_path, deck, gradient, increments, LAWS["cubic"], 0.0, tmp_path)


KNOTTED, ENDS = spline(), np.full(3, 0.13)
#: Laws of strain, and those that also know the loads of both yarns.
LAWS = LAWS | {
    "load ratio": HypoelasticLaw(np.array([30.0, 800.0, 400.0, 1000.0, -300.0]), form=LoadRatio()),
    "spline, load ratio": HypoelasticLaw(
        np.array([*KNOTTED.beta, 40.0, -30.0]), 0.24, ENDS, form=SplineRatio(KNOTTED.form.knots)
    ),
    "spline, crimp": HypoelasticLaw(
        np.array([*KNOTTED.beta, 1.5, 2.5, 12.0]), 0.24, ENDS, form=SplineCrimp(KNOTTED.form.knots)
    ),
}
VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    needs.c_compiler()
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="session")
def umat_function(folder):
    found = ctypes.CDLL(str(material_library(folder))).HYPOELASTIC
    found.restype = None
    return found


@pytest.fixture(autouse=True)
def where_ccx_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def written_constants(law, normal=None, shear=None, *given, **named):
    for name, text in law_files(law).items():
        Path(name).write_text(text)
    values = library.constants(law, *given, **named)
    return (*values[:2], normal or values[2], shear or values[3], *values[4:])


def voigt(tensor):
    return np.array([tensor[i, j] for i, j in VOIGT])


def tensor(components):
    out = np.empty((3, 3))
    for value, (i, j) in zip(components, VOIGT, strict=True):
        out[i, j] = out[j, i] = value
    return out


def numbers(values):
    return np.ascontiguousarray(values, dtype=float)


def array(values):
    return values.ctypes.data_as(ctypes.c_void_p)


def whole(number):
    return ctypes.byref(ctypes.c_int(number))


@dataclass
class MaterialPoint:
    """One integration point (of element 3, point 2) of an analysis, as CalculiX calls it."""

    function: object
    constants: tuple
    orab: tuple = ()
    position: tuple = (0.0, 0.0, 0.0)
    states: int = STATE_VARIABLES + 2
    committed: np.ndarray = field(init=False)

    def __post_init__(self):
        self.committed = np.zeros((4, 8, self.states))

    def call(self, gradient, icmd=1, pnewdt=-1.0, time=math.nan, begun=math.nan):
        """S (6,), dS/dE (6, 6) with engineering shears, state, pnewdt."""
        k, f = numbers(self.constants), numbers(np.asarray(gradient).T)
        trial, stress = self.committed.copy(), np.full(6, 77.0)
        stiff, request, nothing = np.full(21, 77.0), numbers([pnewdt]), np.full(9, np.nan)
        orab, position = numbers([*np.full(7, np.nan), *(self.orab or [0])]), numbers(self.position)
        empty = array(nothing)
        self.function(
            b"@BUBBLEFIT_HYPOELASTIC".ljust(80), whole(3), whole(2), whole(-100 - len(k)), array(k),
            empty, empty, empty, empty, empty, array(f), empty, whole(0), empty, empty,
            array(numbers([time])), array(numbers([begun])), whole(icmd), whole(0), whole(8),
            whole(self.states), array(self.committed),
            array(trial), array(stress), array(stiff), whole(2 if self.orab else 0),
            array(position), array(orab), array(request), whole(0), 80,
        )  # fmt: skip
        square = np.zeros((6, 6))
        # The upper triangle comes column by column.
        column, row = np.tril_indices(6)
        square[row, column] = square[column, row] = stiff
        assert not np.delete(trial.reshape(32, -1), 2 * 8 + 1, axis=0).any()
        return stress, square, trial[2, 1], request[0]

    def commit(self, state):
        self.committed[2, 1] = state


def random_deformations(seed, steps=7, size=0.05):
    """Random 3-D deformation gradients: a fabric stretched, sheared, tilted and turned."""
    random = np.random.default_rng(seed)
    end = np.eye(3) + size * random.normal(size=(3, 3))
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    for s in np.linspace(0, 1, steps + 1)[1:]:
        yield turn @ (np.eye(3) + s * (end - np.eye(3)) + 0.01 * s * random.normal(size=(3, 3)))


def rotation(axis, degrees):
    a, (x, y, z) = math.radians(degrees), np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(a) * k + (1 - math.cos(a)) * k @ k


def expected_response(law, axes, gradient, state, normal, shear):
    """S (6,), dS/dE (6, 6) and state from the Python law; rows of axes: warp, fill, normal."""
    f = gradient @ axes.T
    pk2, stiffness, strain, stress = law.second_piola_kirchhoff(
        f[None, :, :2], state[None, :3], state[None, 3:6]
    )
    c = f.T @ f
    local = np.zeros((3, 3))
    local[0, 0], local[1, 1], local[0, 1] = pk2[0]
    local[2, 2] = normal * 0.5 * (c[2, 2] - 1)
    local[0, 2], local[1, 2] = shear * c[0, 2], shear * c[1, 2]
    local = np.triu(local) + np.triu(local, 1).T
    plane = [0, 1, 3]
    tangent = np.diag([0, 0, normal, 0, shear, shear])
    tangent[np.ix_(plane, plane)] = 0.5 * (stiffness[0] + stiffness[0].T)
    # Strain to material axes, column by column.
    turn = np.empty((6, 6))
    for n, (i, j) in enumerate(VOIGT):
        unit = np.zeros((3, 3))
        unit[i, j] += 0.5
        unit[j, i] += 0.5
        turned = voigt(axes @ unit @ axes.T)
        turned[3:] *= 2
        turn[:, n] = turned
    return (
        voigt(axes.T @ local @ axes),
        turn.T @ tangent @ turn,
        np.concatenate([strain[0], stress[0]]),
    )


def assert_close(found, wanted, tolerance=1e-10):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


def assert_follows_python_law(point, law, axes, gradients):
    for gradient in gradients:
        before = point.committed[2, 1].copy()
        stress, stiffness, state, request = point.call(gradient)
        s, c, end = expected_response(law, axes, gradient, before, 300.0, 25.0)
        assert request == -1.0 and not state[6:].any()
        assert_close(stress, s)
        assert_close(stiffness, c)
        assert_close(state[:6], end)
        point.commit(state)


@pytest.mark.parametrize("name", LAWS)
def test_library_along_random_paths_has_the_stress_of_the_python_law(umat_function, name):
    for seed in range(5):
        point = MaterialPoint(umat_function, written_constants(LAWS[name], 300.0, 25.0))
        assert_follows_python_law(point, LAWS[name], np.eye(3), random_deformations(seed))


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("size", SIZES)
def test_library_increments_of_any_size_from_any_state(umat_function, name, size):
    law = LAWS[name]
    for old, new in increments_everywhere(law, size):
        gradient = np.eye(3)
        gradient[:2, :2] = stretch(new)
        point = MaterialPoint(umat_function, written_constants(law, 300.0, 25.0))
        point.committed[2, 1, :6] = *old, 3.0, -1.0, 0.5
        stress, stiffness, state, request = point.call(gradient)
        s, c, end = expected_response(law, np.eye(3), gradient, point.committed[2, 1], 300.0, 25.0)
        if np.isfinite(s).all():
            assert_close(stress, s)
            assert_close(stiffness, c)
            assert_close(state[:6], end)
        assert (request == -1.0) == np.isfinite(s).all()


def stretch(strain):
    values, axes = np.linalg.eigh([[strain[0], 0.5 * strain[2]], [0.5 * strain[2], strain[1]]])
    return axes @ np.diag(np.exp(values)) @ axes.T


FRAMES = [
    # angle, *ORIENTATION, position, warp and normal that should come of it
    (0.0, (), (1, 2, 3), (1, 0, 0), (0, 0, 1)),
    (45.0, (), (1, 2, 3), (1, 1, 0), (0, 0, 1)),
    (-30.0, (), (1, 2, 3), (math.cos(math.pi / 6), -0.5, 0), (0, 0, 1)),
    (0.0, (0, 2, 0, 3, 5, 0, 1), (1, 2, 3), (0, 1, 0), (0, 0, -1)),
    (90.0, (0, 2, 0, 3, 5, 0, 1), (1, 2, 3), (1, 0, 0), (0, 0, -1)),
    # cylinder about x through (0, 1, 1): warp axial; then warp hoop
    (0.0, (0, 1, 1, 5, 1, 1, -1), (9, 1, 4), (1, 0, 0), (0, 0, 1)),
    (0.0, (0, 1, 1, 5, 1, 1, -1), (9, 4, 5), (1, 0, 0), (0, 3, 4)),
    (90.0, (0, 1, 1, 5, 1, 1, -1), (9, 1, 4), (0, 1, 0), (0, 0, 1)),
    (30.0, (0, 0, 0, 0, 0, 5, -1), (3, 0, 1), (0, -0.5, math.cos(math.pi / 6)), (1, 0, 0)),
]


@pytest.mark.parametrize(("angle", "orab", "position", "warp", "normal"), FRAMES)
def test_material_frame_follows_angle_and_orientation(
    umat_function, angle, orab, position, warp, normal
):
    cylindrical = bool(orab) and orab[-1] < 0
    first, third = (np.asarray(v) / np.linalg.norm(v) for v in (warp, normal))
    given = written_constants(LAWS["cubic"], 300.0, 25.0, angle, 1 if cylindrical else 3)
    axes = np.array([first, np.cross(third, first), third])
    assert_follows_python_law(
        MaterialPoint(umat_function, given, orab, position),
        LAWS["cubic"],
        axes,
        random_deformations(11),
    )


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("angle", [0.0, 35.0])
def test_tangent_of_the_library_is_symmetric_part_of_differences(umat_function, name, angle):
    point = MaterialPoint(umat_function, written_constants(LAWS[name], 300.0, 25.0, angle))
    *_, earlier, gradient = random_deformations(3)
    point.commit(point.call(earlier)[2])
    _, stiffness, _, _ = point.call(gradient)
    step, slope = 1e-6, np.empty((6, 6))
    strain = 0.5 * (gradient.T @ gradient - np.eye(3))
    for n, (i, j) in enumerate(VOIGT):
        sides = []
        for sign in (1, -1):
            change = np.zeros((3, 3))
            change[i, j] = change[j, i] = sign * step * (1.0 if i == j else 0.5)
            # Any F with this C will do: its transposed Cholesky factor.
            factor = np.linalg.cholesky(np.eye(3) + 2 * (strain + change)).T
            sides.append(point.call(factor)[0])
        slope[:, n] = (sides[0] - sides[1]) / (2 * step)
    assert_close(stiffness, 0.5 * (slope + slope.T), 1e-7)


def test_rotation_of_the_body_or_of_everything_changes_nothing(umat_function):
    law, q = LAWS["cubic"], rotation((0, 0, 1), 45)
    point = MaterialPoint(umat_function, written_constants(law, 300.0, 25.0, 20.0))
    *_, gradient = random_deformations(5)
    found = point.call(gradient)
    for degrees in (10, 90, 180, 271):
        turned = point.call(rotation((1, 2, 3), degrees) @ gradient)
        for now, before in zip(turned[:3], found, strict=False):
            assert_close(now, before)
    assert np.abs(point.call(rotation((3, 1, 2), 77))[0]).max() < 1e-11
    straight, turned = (
        MaterialPoint(umat_function, written_constants(law, angle=a)) for a in (0.0, 45.0)
    )
    assert_close(
        turned.call(q @ gradient @ q.T)[0], voigt(q @ tensor(straight.call(gradient)[0]) @ q.T)
    )
    # Stress alone leaves the stiffness.
    stress, stiffness, *_ = point.call(gradient, icmd=3)
    assert (stiffness == 77.0).all()
    assert_close(stress, found[0])


def test_uniaxial_bar_integrates_its_modulus_over_log_strain(umat_function):
    # sigma = int E1 d eps (DESIGN: what Marc's end stresses show), the width left to itself.
    law, steps = LAWS["cubic"], 400
    point = MaterialPoint(umat_function, written_constants(law))
    width = 1.0
    for stretch in np.exp(np.linspace(0, 0.12, steps + 1)[1:]):
        for _ in range(30):
            stress, stiffness, state, _ = point.call(np.diag([stretch, width, 1.0]))
            if abs(stress[1]) < 1e-9:
                break
            width -= stress[1] / (stiffness[1, 1] * width)
        assert abs(stress[1]) < 1e-8
        point.commit(state)
    assert state[3] == pytest.approx(np.polyval(np.polyint(BETA[8:]), 0.12), rel=1e-5)


IMPOSSIBLE = {
    "modulus not positive": (np.diag([1.3, 1.0, 1.0]), np.r_[np.zeros(7), 100.0, 0, 0, -1e3, 100]),
    "nan": (np.full((3, 3), np.nan), BETA), "infinite": (np.diag([np.inf, 1.0, 1.0]), BETA),
    "collapsed": (np.diag([1.0, 0.0, 1.0]), BETA), "turned into itself": (np.ones((3, 3)), BETA),
    "nan through the thickness": (np.diag([1.0, 1.0, np.nan]), BETA),
}  # fmt: skip


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_impossible_deformation_asks_for_a_smaller_increment(umat_function, what):
    gradient, beta = IMPOSSIBLE[what]
    beta = np.where(np.arange(12) == 3, 20.0, beta) if what.startswith("modulus") else beta
    point = MaterialPoint(umat_function, written_constants(HypoelasticLaw(beta)))
    point.commit(np.r_[0.01, 0.02, 0.0, 3.0, 2.0, 0.5, 0.0, 0.0])
    stress, stiffness, state, request = point.call(gradient)
    assert 0 < request < 1
    assert (stress == 77.0).all()
    assert np.isfinite(stiffness).all() and (np.linalg.eigvalsh(stiffness) > 0).all()
    assert (state == point.committed[2, 1]).all()
    # Another point's smaller request stays.
    assert point.call(gradient, pnewdt=0.1)[3] == 0.1


def test_constants_are_in_the_documented_order():
    law = LAWS["incompressible"]
    found = written_constants(law, 300.0, 25.0, 45.0, 1)
    assert found == (0.24, 0.0, 300.0, 25.0, 45.0, 1.0, 0.0, law_number(law), 3.0)
    assert written_constants(LAWS["linear"])[1:4] == (1.0, 800.0, 20.0)
    assert written_constants(MANY)[-1] == 60
    # One line more would be read of a multiple of 8, and more than 21 written beyond a field.
    assert len(found) % 8 and len(found) <= 21
    # A law without stiffness is the analysis' business.
    assert min(written_constants(HypoelasticLaw(np.zeros(12)))[2:4]) > 0


def test_law_file_has_all_digits_and_no_piece_beyond_the_range():
    law = LAWS["tri-linear, held"]
    (text,) = law_files(law).values()
    title, counts, *rows = text.splitlines()
    assert title == f"bubblefit law {law_number(law)}" and counts == "3 2 1"
    pieces = np.array([[float(word) for word in row.split()] for row in rows])
    assert pieces[:, 0].tolist() == [0.01, 0.03, 0.13, 0.02, 0.05, 0.008]
    assert pieces[:, 4].tolist() == [800.0, 450.0, 900.0, 140.0, 110.0, 20.0]
    (text,) = law_files(LAWS["spline"]).values()
    written = [[float(word) for word in row.split()] for row in text.splitlines()[2:7]]
    assert np.array_equal(written, LAWS["spline"].pieces[0][:5])


def test_number_of_a_law_depends_on_its_moduli_and_fits_a_deck():
    numbers = {law_number(law) for law in LAWS.values()}
    # Neither nu12 nor the thickness is in the file.
    assert law_number(LAWS["cubic"]) == law_number(LAWS["other nu12"])
    assert len(numbers) == len(LAWS) - 3
    assert law_number(LAWS["cubic"].with_beta(np.nextafter(BETA, 0))) not in numbers
    # 13 digits is what decks are written with.
    assert max(numbers) < 10**13


def call_in_a_copy(library_path, printed):
    """Return the exit code of a copy of this process in which the library needs the law's file.

    What it prints is in the file `printed`.
    """
    child = os.fork()
    if child == 0:
        try:
            os.dup2(os.open(printed, os.O_WRONLY | os.O_CREAT), 1)
            function = ctypes.CDLL(str(library_path)).HYPOELASTIC
            function.restype = None
            MaterialPoint(function, library.constants(LAWS["spline"])).call(np.eye(3))
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("what", ["none", "another", "cut off", "spoiled", "of other pieces"])
def test_missing_or_damaged_law_file_ends_the_job(umat_function, folder, tmp_path, what):
    ((name, text),) = law_files(LAWS["spline"]).items()
    if what == "another":
        ((name, text),) = law_files(LAWS["cubic"]).items()
    if what == "cut off":
        text = text[: len(text) // 2]
    if what == "spoiled":
        text = text.replace("0.", "O.", 5)
    if what == "of other pieces":
        lines = text.splitlines()
        text = "\n".join([lines[0], "5 3 6", *lines[2:]])
    if what != "none":
        Path(name).write_text(text)
    # A file of another name is another library: nothing is known to it.
    copied = shutil.copy(material_library(folder), tmp_path / "copied.so")
    assert call_in_a_copy(copied, tmp_path / "printed") == 201
    printed = (tmp_path / "printed").read_text()
    assert "*ERROR in HYPOELASTIC: no file *.law in the folder of the deck has" in printed


def test_library_is_compiled_once_per_source(folder, tmp_path, monkeypatch):
    first = material_library(folder)
    stamp = first.stat().st_mtime_ns
    assert material_library(folder) == first and first.stat().st_mtime_ns == stamp
    assert [p.name for p in first.parent.iterdir()] == [first.name] == ["libBUBBLEFIT.so"]
    monkeypatch.setattr(library, "FLAGS", (*library.FLAGS, "-DOTHER"))
    second = material_library(folder)
    source = tmp_path / "law.c"
    source.write_text(library.SOURCE.read_text() + "\n/* edited */\n")
    monkeypatch.setattr(library, "SOURCE", source)
    assert len({first, second, material_library(folder)}) == 3
    source.write_text("#error broken on purpose\n")
    raised(SolverFailure, "broken on purpose", material_library, tmp_path / "cache")
    assert not list((tmp_path / "cache").rglob("*.so"))
    (tmp_path / "file").write_text("")
    raised(OutputError, "BUBBLEFIT_CACHE", material_library, tmp_path / "file")


def test_missing_compiler_is_refused_with_advice(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    raised(SolverFailure, r"C compiler.*install gcc", material_library, tmp_path)
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    raised(SolverFailure, r"'no-such-compiler' that CC names", material_library, tmp_path)


def test_state_is_committed_at_the_end_of_a_step_only(umat_function):
    stretch = np.diag([1.03, 1.02, 1.0])
    stress, _, state, _ = MaterialPoint(umat_function, written_constants(LAWS["cubic"])).call(
        stretch
    )
    at_ends = MaterialPoint(umat_function, written_constants(LAWS["cubic"], whole_times=True))
    inside, _, kept, _ = at_ends.call(stretch, time=0.4, begun=2.0)
    assert np.array_equal(inside, stress) and not kept.any()
    # Sums of increments end a step only nearly at a whole number.
    _, _, kept, _ = at_ends.call(stretch, time=1 - 1e-12, begun=2.0)
    assert np.array_equal(kept, state) and state[0] > 0
    # Up to total time 3 alike, from there at every increment.
    for begun, time in ((2.0, 0.4), (3.0, 0.0), (3.0, 1e-3), (3.0, 0.4)):
        point = MaterialPoint(umat_function, written_constants(LAWS["cubic"], whole_until=3))
        _, _, kept, _ = point.call(stretch, time=time, begun=begun)
        assert kept[0] > 0 if begun == 3.0 else not kept.any()


# A patch of 2 mm x 1 mm: nodes (x, y, z) and element of each type, in CalculiX's order.
QUAD = [(0, 0), (2, 0), (2, 1), (0, 1)]
EIGHT = [*QUAD, (1, 0), (2, 0.5), (1, 1), (0, 0.5)]
PATCHES = {
    "S4": [(x, y, 0) for x, y in QUAD],
    "S8R": [(x, y, 0) for x, y in EIGHT],
    "C3D8I": [(x, y, z) for z in (0, 0.8) for x, y in QUAD],
}
AROUND_Y = "*ORIENTATION, NAME=WARP, SYSTEM=CYLINDRICAL\n"
ORIENTATIONS = {
    "none": (0.0, "", 0.0),
    "angle": (45.0, "", 45.0),
    "orientation": (0.0, "*ORIENTATION, NAME=WARP\n1., 1., 0., -1., 1., 0.\n", 45.0),
    "both": (15.0, "*ORIENTATION, NAME=WARP\n1., 1., 0., -1., 1., 0.\n", 60.0),
    # Far out on a cylinder about y, z is radial and x is the hoop direction.
    "axial": (0.0, f"{AROUND_Y}1., 0., -1e6, 1., 1., -1e6\n", 90.0),
    "hoop": (90.0, f"{AROUND_Y}1., 0., -1e6, 1., 1., -1e6\n", 180.0),
}


def patch_deck(element, law, gradient, increments, angle, orientation):
    nodes, name, solid = PATCHES[element], library.MATERIAL, element == "C3D8I"
    moves = np.array(nodes) @ (gradient - np.eye(3)).T
    given = written_constants(law, angle=angle, normal_axis=1 if AROUND_Y in orientation else 3)
    written = [f"{v:.12e}" for v in given]
    section = f"*{'SOLID' if solid else 'SHELL'} SECTION, ELSET=PATCH, MATERIAL={name}"
    lines = [
        "*NODE, NSET=ALL", *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(nodes, 1)),
        f"*ELEMENT, TYPE={element}, ELSET=PATCH",
        ", ".join(map(str, [1, *range(1, len(nodes) + 1)])), *orientation.splitlines(),
        f"*MATERIAL, NAME={name}", f"*USER MATERIAL, CONSTANTS={len(written)}",
        *(", ".join(written[i : i + 8]) for i in range(0, len(written), 8)),
        *("*DEPVAR", str(STATE_VARIABLES)), section + (", ORIENTATION=WARP" if orientation else ""),
        *([] if solid else ["0.8"]),
        *("*STEP, NLGEOM, INC=1000", "*STATIC, DIRECT", f"{1 / increments}, 1.", "*BOUNDARY"),
    ]  # fmt: skip
    for i, move in enumerate(moves, 1):
        lines += [f"{i}, {axis}, {axis}, {move[axis - 1]:.12e}" for axis in (1, 2, 3)]
    lines += [f"*EL PRINT, ELSET=PATCH, GLOBAL=YES, FREQUENCY={increments}", "S"]
    return "\n".join([*lines, "*END STEP", ""])


# 60 pieces of four coefficients, where CalculiX has place for 21 constants.
KNOTS = np.linspace(0, 0.13, 21)
WAVES = np.concatenate([size * (1 + 0.3 * np.sin(40 * KNOTS)) for size in (20, 140, 800)])
MANY = HypoelasticLaw(WAVES, strain_range=[0.13] * 3, form=Spline.at([KNOTS.tolist()] * 3))


def run_patch(ccx, folder, deck, libraries):
    (folder / "patch.inp").write_text(deck)
    environment = {**os.environ, "LD_LIBRARY_PATH": str(libraries)}
    return subprocess.run([ccx.path, "patch"], cwd=folder, env=environment, capture_output=True,
                          text=True, timeout=60)  # fmt: skip


def check_patch(ccx, folder, deck, gradient, increments, law, warp_at, libraries):
    """Run the deck; compare its Cauchy stresses, printed with seven digits, with the law's."""
    done = run_patch(ccx, folder, deck, libraries)
    assert done.returncode == 0, done.stdout[-2000:]
    printed = [line.split() for line in (folder / "patch.dat").read_text().splitlines()]
    found = np.array([row[2:] for row in printed if len(row) == 8 and row[0] == "1"], float)
    assert len(found) >= 4
    axes, state = rotation((0, 0, 1), warp_at).T, np.zeros(6)
    for step in range(1, increments + 1):
        f = np.eye(3) + step / increments * (gradient - np.eye(3))
        s, _, state = expected_response(law, axes, f, state, 1.0, 1.0)
    wanted = voigt(f @ tensor(s) @ f.T / np.linalg.det(f))
    np.testing.assert_allclose(found, np.tile(wanted, (len(found), 1)), atol=2e-6 * wanted.max())


@pytest.mark.parametrize(
    ("element", "how", "law"),
    [
        *((element, how, LAWS["cubic"]) for element in PATCHES for how in list(ORIENTATIONS)[:4]),
        *(("C3D8I", how, LAWS["cubic"]) for how in ("axial", "hoop")),
        ("S4", "angle", LAWS["tri-linear"]),
        ("C3D8I", "angle", LAWS["tri-linear"]),
        ("S8R", "angle", LAWS["spline"]),
        ("C3D8I", "angle", LAWS["jumps and kinks"]),
        ("S8R", "angle", MANY),
    ],
)
def test_patch_in_ccx_has_the_stress_of_the_python_law(ccx, tmp_path, element, how, law):
    angle, orientation, warp_at = ORIENTATIONS[how]
    gradient, increments = np.eye(3), 10
    gradient[:2, :2] = [[1.06, 0.03], [0.05, 1.04]]
    deck = patch_deck(element, law, gradient, increments, angle, orientation)
    libraries = material_library().parent
    check_patch(ccx, tmp_path, deck, gradient, increments, law, warp_at, libraries)


def test_ccx_cuts_its_increments_where_a_modulus_runs_out(ccx, tmp_path):
    gradient, libraries = np.diag([1.1, 1.0, 1.0]), material_library().parent
    deck = patch_deck("C3D8I", GONE, gradient, 10, 0.0, "")
    done = run_patch(ccx, tmp_path, deck.replace("*STATIC, DIRECT", "*STATIC"), libraries)
    assert "requested by a material user routine" in done.stdout and done.returncode != 0
    assert "stresses" not in (tmp_path / "patch.dat").read_text()
    deck = patch_deck("C3D8I", LAWS["cubic"], gradient, 10, 0.0, "")
    done = run_patch(ccx, tmp_path, deck.replace("*DEPVAR\n6", "*DEPVAR\n3"), libraries)
    assert done.returncode == 201
    assert "*ERROR in HYPOELASTIC: 9 constants and *DEPVAR 6 are needed" in done.stdout
