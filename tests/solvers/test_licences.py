"""solvers/licences.py: licences counted and waited for."""

import os
import signal
import stat

import pytest
from bubblefit.errors import LicenceDenied
from bubblefit.solvers import licences
from bubblefit.solvers.base import Announcement, hearing
from bubblefit.solvers.licences import held, locked, patiently
from bubblefit.solvers.settings import LicenceSettings

from ..builders.counted_program import CountedSolver, counted_copies
from ..support.commands import FORK, in_processes, wait_for
from ..support.refusals import complaint, raised

LAW = None


def settings(folder, licences=2, **more):
    return LicenceSettings(licences=licences, licence_folder=str(folder / "locks"), **more)


def licensed(solver, given):
    return licences.licensed(solver, solver.name, given.model_dump(exclude_unset=True))


@pytest.mark.parametrize("count", [2, None])
def test_runs_at_once_never_exceed_the_licences(tmp_path, count):

    def work(process):
        solver = CountedSolver(tmp_path / "runs", 0.02 if count else 0.3)
        if count:
            solver = licensed(solver, settings(tmp_path, count))
        for job in range(5 if count else 1):
            solver.run(f"{process}.{job}", LAW)

    in_processes(4, work)
    found = counted_copies(tmp_path / "runs")
    assert found.most == count if count else found.most > 2
    assert found.begun == found.ended
    assert found.ended == {f"{p}.{j}": 1 for p in range(4) for j in range(5 if count else 1)}


def test_licence_of_a_killed_holder_is_free(tmp_path):
    folder = tmp_path / "runs"

    def work(process):
        licensed(CountedSolver(folder, 60.0), settings(tmp_path, 1)).run("killed", LAW)

    holder = FORK.Process(target=work, args=(0,))
    holder.start()
    wait_for(lambda: (folder / "log").exists())
    assert holder.pid is not None
    os.kill(holder.pid, signal.SIGKILL)
    holder.join()
    licensed(CountedSolver(folder), settings(tmp_path, 1)).run("next", LAW)
    found = counted_copies(folder)
    assert found.most == 1 and found.ended == {"next": 1}


def test_default_licence_folder_is_shared_by_all_users(tmp_path, monkeypatch):
    monkeypatch.setattr(licences, "FOLDER", tmp_path / "machine")
    old = os.umask(0o077)
    try:
        with locked("acme", 1, None, pytest.fail):
            pass
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "machine").stat().st_mode) == 0o1777
    assert stat.S_IMODE((tmp_path / "machine" / "acme-1.lock").stat().st_mode) == 0o666


def test_lock_holds_for_the_present_file_only(tmp_path, monkeypatch):
    with locked("acme", 1, tmp_path / "a", pytest.fail):
        for program, folder in (("b", "a"), ("acme", "b")):  # these count apart
            with locked(program, 1, tmp_path / folder, pytest.fail):
                pass
    # Whoever opened it before the other one was there may not run beside who locks that.
    with locked("acme", 1, tmp_path / "a", pytest.fail) as file:
        (tmp_path / "a" / "acme-1.lock").unlink()
        with locked("acme", 1, tmp_path / "a", pytest.fail) as other:
            assert not os.path.samestat(os.fstat(file), os.fstat(other))
            assert licences._any(tmp_path / "a", "acme", 1) is None
    # Tidied away, and made again by somebody else, between opening and locking it.
    opened = licences._opened

    def replaced(path):
        file = opened(path)
        path.unlink()
        path.touch()
        return file

    monkeypatch.setattr(licences, "_opened", replaced)
    assert licences._any(tmp_path / "a", "acme", 1) is None
    monkeypatch.undo()
    # A link is not followed, and a folder must be one.
    (tmp_path / "victim").write_text("")
    (tmp_path / "acme-1.lock").symlink_to(tmp_path / "victim")
    for place in (tmp_path, tmp_path / "victim"):
        given = settings(tmp_path, 1).model_copy(update={"licence_folder": str(place)})
        said = complaint(held("acme", given).__enter__)
        assert said.startswith(f"{place}: solver.acme.licence_folder:")


@pytest.fixture
def pauses(monkeypatch):
    made = []
    monkeypatch.setattr(licences.time, "sleep", made.append)
    monkeypatch.setattr(licences.time, "monotonic", lambda: sum(made))
    monkeypatch.setattr(licences.random, "uniform", lambda low, high: (low + high) / 2)
    yield made


def failing_run(count, folder, error=LicenceDenied):
    """Fails so many times, then gives 7; every try leaves a scratch folder."""
    tries = []

    def run():
        if len(tries) == count:
            return 7
        tries.append(folder / f"try-{len(tries)}")
        tries[-1].mkdir()
        raise error("no licence: none free", "acme", 5, "FLEXlm error -4", tries[-1])

    return run, tries


def test_pauses_after_denials_double_up_to_tenfold(tmp_path, pauses):
    run, tries = failing_run(7, tmp_path)
    heard = []
    given = settings(tmp_path, licence_wait=1000.0, licence_retry=3.0)
    with hearing(heard.append):
        assert patiently(run, "acme", given) == 7
    assert pauses == [3.0, 6.0, 12.0, 24.0, 30.0, 30.0, 30.0]
    words = "acme: no licence: none free; trying again in 6 s, for 997 s more at most"
    assert heard[1] == Announcement(words)
    assert not any(folder.exists() for folder in tries)
    # After the stated time it is a failure.
    pauses.clear()
    (tmp_path / "more").mkdir()
    run, tries = failing_run(99, tmp_path / "more")
    given = settings(tmp_path, licence_wait=20.0, licence_retry=4.0)
    failure = raised(LicenceDenied, "", patiently, run, "acme", given)
    assert pauses == [4.0, 8.0, 8.0]  # the last one is cut: it is tried once more at the very end
    assert failure.reason == "no licence: none free; 4 tries in 20 s (licence_wait)"
    assert (failure.exit_number, failure.log_tail) == (5, "FLEXlm error -4")
    assert [folder.exists() for folder in tries] == [False, False, False, True]
    assert failure.scratch == tries[-1]
