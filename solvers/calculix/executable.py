"""Which ccx to run, and whether it can load material libraries."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ...caching import cache_folder
from ...errors import InputError, SolverFailure

VARIABLE = "BUBBLEFIT_CCX"
#: Origins of a ccx that somebody chose: there has to be nothing wrong with these.
NAMED, ENVIRONMENT, BUILT, FOUND = "named", VARIABLE, "make calculix", "PATH"
ADVICE = (
    "in bubblefit's repository, `make calculix` builds one; or name one by --ccx or BUBBLEFIT_CCX"
)
#: Words that only a ccx built with CALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT has in it.
TRACE = b"empty library name"
SECONDS = 30.0


@dataclass(frozen=True)
class Executable:
    """A ccx: where, version ("?" when it does not tell), how it was found.

    external: it can load material libraries; None when that cannot be seen (a wrapper script).
    """

    path: Path
    version: str
    external: bool | None
    origin: str


def find_ccx(named: Path | str | None = None) -> Executable:
    """The ccx to run: `named`, else BUBBLEFIT_CCX, else the one `make calculix` built, else PATH.

    Of those on the PATH, the first one that can load material libraries. What somebody named is
    taken or refused, never passed over.

    Raises
    ------
    InputError : the ccx that was named is not there or is no program.
    SolverFailure : there is none, or it cannot load material libraries.
    """
    without = None
    for candidate in every_ccx(named):
        if candidate.external is not False:
            return candidate
        if candidate.origin in (NAMED, ENVIRONMENT):
            raise SolverFailure(f"{candidate.path} cannot load material libraries; {ADVICE}",
                                "calculix")  # fmt: skip
        without = without or candidate
    if without is not None:
        problem = f"no ccx that can load material libraries ({without.path} cannot); {ADVICE}"
        raise SolverFailure(problem, "calculix")
    raise SolverFailure(f"there is no ccx; {ADVICE}", "calculix")


def every_ccx(named: Path | str | None = None) -> list[Executable]:
    """All there are, in the order in which `find_ccx` prefers them, each once.

    Raises
    ------
    InputError : as for `find_ccx`.
    """
    seen: set[Path] = set()
    found = []
    for path, origin in _places(named):
        real = path.resolve()
        if real in seen:
            continue
        seen.add(real)
        found.append(Executable(path, version_of(path), carries_external(path), origin))
    return found


def carries_external(path: Path) -> bool | None:
    """Whether a ccx can load material libraries; None when it is no binary of ours to look into."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not content.startswith(b"\x7fELF"):
        return None
    return TRACE in content


def version_of(path: Path) -> str:
    """What `ccx -v` says, "?" when it says nothing of the kind."""
    with suppress(OSError, subprocess.SubprocessError):
        done = subprocess.run(
            [path, "-v"], capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL
        )
        said = re.search(rb"Version\s+(\S+)", done.stdout)
        if said:
            return said[1].decode(errors="replace")
    return "?"


def _places(named: Path | str | None) -> Iterator[tuple[Path, str]]:
    if named is not None:
        yield _program(named, "ccx"), NAMED
    chosen = os.environ.get(VARIABLE)
    if chosen:
        yield _program(chosen, VARIABLE), ENVIRONMENT
    built = (cache_folder() / "calculix").glob("ccx-*-external/ccx")
    # The newest first: a distribution that moves on leaves the older one behind.
    for path in sorted(built, key=lambda p: p.stat().st_mtime_ns, reverse=True):
        if _runs(path):
            yield path, BUILT
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        if not folder:
            continue
        with suppress(OSError):
            for path in sorted(Path(folder).glob("ccx*")):
                if re.fullmatch(r"ccx(_[0-9][0-9.]*\w*)?", path.name) and _runs(path):
                    yield path, FOUND


def _program(path: Path | str, field: str) -> Path:
    """The path of a program that somebody named; a bare name is looked up on the PATH."""
    given = Path(os.path.expanduser(path))
    if os.sep not in str(path):
        for folder in os.environ.get("PATH", "").split(os.pathsep):
            if folder and _runs(Path(folder) / given):
                return Path(folder) / given
    if not given.is_file():
        raise InputError(given, field, "there is no such file; name the ccx to run")
    if not _runs(given):
        raise InputError(given, field, "is not executable; chmod +x it, or name another ccx")
    # Runs happen in a scratch folder.
    return given.absolute()


def _runs(path: Path) -> bool:
    return path.is_file() and os.access(path, os.X_OK)
