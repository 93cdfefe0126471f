"""Licences of an external program: counted while it runs, requested again where one is denied.

On one machine each is a file locked by the run that holds it and by the program, which inherits the
open file (not on Windows): the kernel releases it however they end. Users share the files, which
are empty and never removed. In a cluster a Dask scheduler leases licences. A lease that is not
renewed is free again after `distributed.scheduler.locks.lease-timeout`, 30 s by default.
"""

import os
import random
import socket
import stat
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from ..errors import BubblefitError, InputError, LicenceDenied, SolverFailure
from ..lazy_modules import filelock
from . import base
from .process import CONNECT_S, check_wanted, dask, kept_open
from .scratch import remove
from .settings import SCHEDULER, LicenceSettings, licence_settings

T = TypeVar("T")
#: Factor by which pauses between tries grow.
GROWTH = 2.0
#: Longest pause over the first one.
LONGEST = 10.0
#: One place for every user of the machine, whatever TMPDIR says.
FOLDER = Path("/tmp/bubblefit-licences")  # noqa: S108 (its files hold nothing)
if os.name == "nt":
    FOLDER = Path(os.environ.get("PROGRAMDATA", tempfile.gettempdir())) / "bubblefit-licences"
#: s between two tries of the locks, at first.
SOON_S = 0.02
#: s between two tries of the locks, at most.
LATER_S = 1.0
#: s between two looks at the scheduler.
LOOK_S = 1.0
_clients: dict[tuple[str, int], Any] = {}


def licensed(solver: base.Solver, name: str, options: Mapping[str, Any]) -> base.Solver:
    """Make each run of an external solver hold a licence, and be tried again if it is denied one.

    Licences are held if the options count them, and runs tried again if the options give a time to
    wait. Returns the same solver, its `run` replaced; runs raise as the solver's and as `held`.

    Parameters
    ----------
    solver : Solver
    name : str
        Name of the solver's table of options.
    options : mapping
        Of the solver, those of licences among them.
    """
    settings = licence_settings(name, {k: v for k, v in options.items() if k != SCHEDULER})
    if not solver.external or (settings.licences is None and settings.wait <= 0):
        return solver

    def with_one(run: Callable[..., T]) -> Callable[..., T]:
        def run_licensed(*given_to_run: Any, **named: Any) -> T:
            with held(solver.name, settings, options.get(SCHEDULER)):
                return patiently(lambda: run(*given_to_run, **named), solver.name, settings)

        return run_licensed

    solver.run = with_one(solver.run)  # type: ignore[method-assign]
    if isinstance(solver, base.DifferentiatingSolver):
        slopes = with_one(solver.run_with_sensitivity)
        solver.run_with_sensitivity = slopes  # type: ignore[method-assign]
    return solver


@contextmanager
def held(name: str, settings: LicenceSettings, scheduler: str | None = None) -> Iterator[None]:
    """Hold a licence, of the machine, then of the cluster; InputError, BubblefitError: no count."""
    if settings.licences is None:
        yield
        return
    me = f"{socket.gethostname()} {os.getpid()} {threading.get_ident()} {name}"
    has_logged = False

    def waiting() -> None:
        nonlocal has_logged
        check_wanted()
        if not has_logged:
            base.announce(f"waiting for a licence of {name}", me)
        has_logged = True

    folder = settings.licence_folder
    with ExitStack() as stack:
        try:
            file = stack.enter_context(
                locked(name, settings.licences, None if folder is None else Path(folder), waiting)
            )
            if scheduler is not None:
                stack.enter_context(leased(name, settings.licences, scheduler, waiting))
        finally:
            if has_logged:
                base.announce("", me)
        stack.enter_context(kept_open(file))
        yield


def patiently(run: Callable[[], T], name: str, settings: LicenceSettings) -> T:
    """Run; where a licence was denied, try again in time, after longer and random pauses."""
    start = time.monotonic()
    pause = settings.licence_retry
    tries = 1
    while True:
        try:
            return run()
        except SolverFailure as failure:
            log = f"{failure.reason}\n{failure.log_tail}".lower()
            words = (phrase.lower() in log for phrase in settings.licence_denied)
            if not (isinstance(failure, LicenceDenied) or any(words)):
                raise
            remaining = start + settings.wait - time.monotonic()
            if remaining <= 0:
                reason = failure.reason
                if tries > 1:
                    reason += f"; {tries} tries in {settings.wait:g} s (licence_wait)"
                raise LicenceDenied(
                    reason, name, failure.exit_number, failure.log_tail, failure.scratch
                ) from None
            refusal = failure.reason
            scratch = failure.scratch
        if scratch is not None:
            remove(scratch)  # only that of the last try is kept
        seconds = min(pause * random.uniform(0.5, 1.5), remaining)  # noqa: S311 (no secret)
        base.announce(
            f"{name}: {refusal}; trying again in {seconds:.3g} s, "
            f"for {remaining:.0f} s more at most"
        )
        time.sleep(seconds)
        pause = min(GROWTH * pause, LONGEST * settings.licence_retry)
        tries = tries + 1


# On one machine


@contextmanager
def locked(
    name: str,
    count: int,
    folder: Path | None,
    waiting: Callable[[], None],
) -> Iterator[int]:
    """Hold one of `count` licences; yield its open file; call `waiting` while there is none."""
    place = FOLDER if folder is None else folder
    pause = SOON_S
    while True:
        try:
            if not place.is_dir():
                with suppress(FileExistsError):
                    place.mkdir(parents=True)
                    if place == FOLDER:  # the machine's own is for all users
                        place.chmod(0o1777)
            file = _any(place, name, count)
        except OSError as error:
            problem = f"no licence can be counted here: {error.strerror}; name another folder"
            raise InputError(place, f"solver.{name}.licence_folder", problem) from None
        if file is not None:
            break
        waiting()
        time.sleep(pause * random.uniform(0.5, 1.5))  # noqa: S311 (no secret)
        pause = min(LATER_S, 1.5 * pause)
    try:
        yield file
    finally:
        os.close(file)


def _any(place: Path, name: str, count: int) -> int | None:
    """Lock one of the files; return it, None where all are locked."""
    for number in random.sample(range(1, count + 1), count):
        path = place / f"{name}-{number}.lock"
        file = _opened(path)
        try:
            # A file that was tidied away meanwhile is not the one of that name now.
            if filelock.lock_descriptor(file, blocking=False) and os.path.samestat(
                os.fstat(file), os.lstat(path)
            ):
                with suppress(OSError, TypeError):
                    os.utime(file)  # files of old date are what is tidied away
                return file
        except FileNotFoundError:
            pass
        except BaseException:
            os.close(file)
            raise
        os.close(file)
    return None


def _opened(path: Path) -> int:
    """Open or make the file, not both at once: the kernel refuses that in a folder of all users."""
    flags = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)
    while True:
        try:
            file = os.open(path, flags)
        except FileNotFoundError:
            with suppress(FileExistsError):
                file = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
                with suppress(OSError, AttributeError):  # not on Windows
                    os.fchmod(file, 0o666)  # whatever the umask
                return file
            continue
        if not stat.S_ISREG(os.fstat(file).st_mode):
            os.close(file)
            raise OSError(0, f"{path.name} is no file")
        return file


# In a cluster


@contextmanager
def leased(
    name: str,
    count: int,
    address: str,
    waiting: Callable[[], None],
) -> Iterator[None]:
    """Hold one of the licences of a program in the cluster of a scheduler.

    Parameters
    ----------
    name : str
        Of the program.
    count : int
        Number of its licences.
    address : str
        Of the scheduler.
    waiting : callable
        Called while no licence is free.

    Raises
    ------
    InputError
        Another number is counted there, or Dask is missing.
    BubblefitError
        The scheduler does not answer.
    """
    distributed = dask()
    try:
        connection = _connection(distributed, address)
        semaphore = distributed.Semaphore(count, f"bubblefit licences of {name}", *connection)
        semaphore.register()
        while not semaphore.acquire(LOOK_S):
            waiting()
    except ValueError as error:
        problem = f"the cluster counts another number of them already ({error})"
        raise InputError(None, f"solver.{name}.licences", problem) from None
    except OSError as error:
        failure = BubblefitError(f"{address}: the Dask scheduler leases no licence: {error}")
        failure.exit_code = 4
        raise failure from None
    try:
        yield
    finally:
        with suppress(OSError):  # it is gone, and the lease with it
            semaphore.release()
        if hasattr(semaphore, "refresh_callback"):  # none where leases never time out
            semaphore.refresh_callback.stop()


def _connection(distributed: Any, address: str) -> tuple[Any, Any]:
    """Return a connection to the scheduler and its event loop; OSError where nothing answers."""
    with suppress(ValueError):  # this is no worker
        worker = distributed.get_worker()
        return worker.scheduler, worker.loop
    # A copy of a process (fork) has no use of the connections of the original.
    key = address, os.getpid()
    client = _clients.get(key)
    if client is None or client.status != "running":
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        _clients[key] = client
    return client.scheduler, client.loop
