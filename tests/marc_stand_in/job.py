"""One job from its deck to its files, and how it ends."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

from .command import Command
from .endings import NORMAL, NOT_COMPILED, Ended, NotCompiled
from .faults import Fault
from .fields import DeckError
from .journals import Journals
from .reading import read_deck


def run(command: Command, environment: Mapping[str, str] | None = None) -> tuple[int, str]:
    """Run a job; what run_marc returns, and what it prints."""
    fault = Fault(os.environ if environment is None else environment, command.job)
    if fault.is_("silent"):
        return 0, ""
    if fault.is_("stale"):
        for left in (Path(fault.folder) / "stale").iterdir():
            shutil.copy2(left, command.folder / left.name)
        return 1, "could not obtain license for MARC"
    journals = Journals(command.folder, command.job)
    if fault.is_("licence"):
        # From what users quote of Marc's output; there is no exit number in the .sts.
        journals.error("could not obtain license: license server is down or has none free")
        journals.end(None)
        return 1, "could not obtain license for MARC"
    try:
        if command.user is not None and fault.is_("not compiled"):
            raise NotCompiled("hypela2.f:1: Error: told to fail")
        content = read_deck(command.folder / f"{command.job}.dat")
        # Compiled code: a deck with a mistake in it does not wait for that.
        from .solving import solve

        solve(content, command, journals, fault)
        number = NORMAL
    except DeckError as error:
        where = f" in line {error.line} of the input" if error.line else ""
        journals.error(f"{error.problem}{where}")
        number = error.number
    except NotCompiled as error:
        journals.log(str(error))
        journals.end(None)
        (command.folder / f"{command.job}.sts").unlink()
        return NOT_COMPILED, f"{error}\n compile or link error\n Exit number {NOT_COMPILED}"
    except OSError as error:
        journals.error(f"write error: {error.strerror}")
        journals.end(None)
        return 1, f"write error: {error.strerror}"
    except Ended as end:
        number = end.number
        if end.problem:
            journals.error(end.problem)
    journals.end(number)
    code = 0 if number == NORMAL else number % 256 or 1
    code = {"code0": 0, "code1": 1}.get(fault.kind, code)
    return code, f" Exit number {number}"
