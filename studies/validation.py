"""Does a fit foretell what it was not given? Tests, or parts of them, left out in turn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import cast

from .. import __version__
from ..errors import InputError
from ..experiments.fittable import FittableTest, PreparedTest
from ..fits.fit import Event
from ..fits.project import Project
from ..fits.result import Fit
from ..fits.setup import prepare_fit
from ..materials.card import MaterialCard, thickness_difference
from .held_out import HeldOut, held_out
from .law_candidates import candidates, plain
from .left_out import judged_with, parts_of
from .left_out_record import recorded
from .marked import begin_study
from .stored_fit import stored_fit
from .validated import Judged, Validation

STARTS = 3
#: What is left out unless something else is asked for: whole tests.
TESTS = "tests"
#: Told the words of what is fitted as its turn comes, then the records of its starts; None now
#: and then.
Progress = Callable[[str | Event | None], None]


def validate(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    leave: str = TESTS,
    starts: int = STARTS,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    command_line: Sequence[str] | None = None,
) -> Validation:
    """Fit all tests, then all but each in turn, and judge the fits at the test left out.

    Offsets and the sheet's surface of the test left out are no property of the fabric: they are
    fitted to it, with the law as it is. Of a part of a test (a frame) they are what the rest of
    the test has found.

    Parameters
    ----------
    tests : by name or kind; every test that can be fitted unless given.
    forms : of the moduli, as for `compare_laws`; the project's own unless given.
    leave : "tests", or a sort of parts that the tests have: "frames" of a bubble, "specimens" or
        "directions" of strips.
    out : folder with a folder for each fit, in which everything is written as it ends.

    Raises
    ------
    InputError : in the project or its data, fewer than two tests or parts, nothing to go on with.
    OutputError, NoFeasibleStart, SolverFailure : as `bubblefit.fit`.
    """
    tell = progress or (lambda event: None)
    project = project.with_fit(starts=starts)
    chosen = project.chosen(tests, fitted=True)
    if leave == TESTS and len(chosen) < 2:
        raise InputError(project.path, "", "one test is left out of two or more: there is only one")
    projects = candidates(project, forms) if forms else {project.law.form: project}
    setups, parts = {}, {}
    if leave != TESTS:  # a mistake shows before the first fit
        able = cast(Sequence[FittableTest], chosen)
        setups = {form: prepare_fit(own, able) for form, own in projects.items()}
        parts = {form: parts_of(setup, leave) for form, setup in setups.items()}
    folder = None if out is None else Path(out)
    if folder is not None:
        of = {"version": __version__, "forms": ", ".join(projects), "left out": leave}
        begin_study(folder, of, resume, overwrite, _places(projects, len(chosen)))
    judged = []

    def fitted(own: Project, name: str, names: Sequence[str], place: str) -> Fit:
        tell(name)
        into = None if folder is None else folder / place
        return stored_fit(
            own, names, into, resume=resume, overwrite=overwrite, progress=tell,
            command_line=command_line,
        )  # fmt: skip

    for form, own in projects.items():
        names = [test.name for test in chosen]
        together = fitted(own, f"{form}: all tests", names, f"{plain(form)}-all")
        if leave != TESTS:
            file = f"{plain(form)}-without-{leave}.json"
            if overwrite and folder is not None:
                (folder / file).unlink(missing_ok=True)
            tell(f"{form}: without each of {len(parts[form])} {leave}")
            told = recorded(setups[form], parts[form], starts, folder, file, tell)
            pairs = zip(parts[form], told, strict=True)
            judged += [Judged(form, one, judged_with(together, part)) for part, one in pairs]
            continue
        for k, test in enumerate(together.setup.tests):
            others = [name for name in names if name != test.test.name]
            words, place = f"{form}: without {test.test.name}", f"{plain(form)}-without-{k + 1}"
            alone = fitted(own, words, others, place)
            judged.append(Judged(form, _judge(alone, test), _judge(together, test)))
    return Validation(project.title, tuple(judged), leave)


def judge_cards(
    project: Project,
    cards: Mapping[str, MaterialCard],
    tests: str | Sequence[str] | None = None,
) -> Validation:
    """Cards at the tests of a project, without any fit of the law.

    Raises
    ------
    InputError : in the project or its data, a card of another thickness than the fabric's.
    """
    for name, card in cards.items():
        if (words := thickness_difference(card, project.fabric.thickness)) is not None:
            raise InputError(project.path, "fabric.thickness", f"{name}: {words}")
    chosen = project.chosen(tests, fitted=True)
    setup = prepare_fit(project, cast(Sequence[FittableTest], chosen))
    judged = [
        Judged(name, held_out(test, card.law, setup.make_solver))
        for name, card in cards.items()
        for test in setup.tests
    ]
    return Validation(project.title, tuple(judged))


def _places(forms: Iterable[str], tests: int) -> list[str]:
    """Folders of the fits."""
    names = ["all", *(f"without-{k + 1}" for k in range(tests))]
    return [f"{plain(form)}-{name}" for form in forms for name in names]


def _judge(found: Fit, test: PreparedTest) -> HeldOut:
    return held_out(test, found.card.law, found.setup.make_solver)
