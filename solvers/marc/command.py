"""The command that starts Marc, and whether there is one."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ...errors import InputError, SolverFailure
from .settings import VARIABLE, MarcSettings

ADVICE = (
    f"name run_marc in [solver.marc] executable, by --marc, or in {VARIABLE}; "
    "see `bubblefit docs marc`"
)
SECONDS = 60.0


def run_command(settings: MarcSettings, job: str, subroutine: str | None) -> list[str]:
    """Marc on `job`.dat in the current folder, in the foreground and asking nothing.

    Parameters
    ----------
    subroutine : file name of user code, which Marc compiles, where the law needs it.
    """
    older = settings.options == "older"
    words = [settings.executable, "-jid" if older else "-j", job, "-v", "no", "-b", "no"]
    if older:
        words += ["-nprocd", str(settings.processors)]
        if settings.threads > 1:
            words += ["-nthread", str(settings.threads)]
    else:
        words += ["-nte", str(settings.threads), "-nts", str(settings.threads)]
        if settings.processors > 1:
            words += ["-nps", str(settings.processors)]
    if subroutine is not None:
        words += ["-u", subroutine]
    return with_modules(settings.modules, [*words, *settings.arguments])


def with_modules(modules: Sequence[str], words: Sequence[str]) -> list[str]:
    """The command in a login shell that has loaded `modules`; as it is without any."""
    if not modules:
        return list(words)
    load = " && ".join(f"module load {shlex.quote(name)}" for name in modules)
    # The command's own words never become text of the shell.
    return ["/bin/bash", "-lc", f'{load} && exec "$@"', "bash", *words]


def find_marc(settings: MarcSettings) -> Path | None:
    """Where run_marc is; None where only the loaded modules know.

    Raises
    ------
    InputError : the one that was named is not there or is no program.
    SolverFailure : there is none on the PATH.
    """
    given = Path(os.path.expanduser(settings.executable))
    if os.sep in settings.executable:
        if not given.is_file():
            raise InputError(given, "marc", "there is no such file; name the run_marc to run")
        if not os.access(given, os.X_OK):
            raise InputError(given, "marc", "is not executable; chmod +x it, or name another")
        return given.absolute()
    if settings.modules:
        return _in_modules(settings)
    found = shutil.which(settings.executable)
    if found is None:
        raise SolverFailure(f"there is no {settings.executable} on the PATH; {ADVICE}", "marc")
    return Path(found)


def _in_modules(settings: MarcSettings) -> Path | None:
    """As the shell sees it after `module load`."""
    ask = with_modules(settings.modules, ["/bin/sh", "-c", 'command -v "$1"', "sh",
                                          settings.executable])  # fmt: skip
    said = None
    with suppress(OSError, subprocess.SubprocessError):
        said = subprocess.run(ask, capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL)
    if said is None or said.returncode != 0:
        lines = said.stderr.decode(errors="replace").strip().splitlines() if said else []
        why = f" ({lines[-1]})" if lines else ""
        names = ", ".join(settings.modules)
        problem = f"modules {names} give no {settings.executable}{why}; {ADVICE}"
        raise SolverFailure(problem, "marc")
    path = said.stdout.decode(errors="replace").strip().splitlines()
    return Path(path[-1]) if path else None
