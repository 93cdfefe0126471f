"""The output folder of a fit or of a series of predictions: whose it is, and going on with it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError, OutputError
from ..writing import remove_cut, telling, write_text
from .differences import Facts, differences

RUN, RESULT = "run.json", "result.json"
#: What results came from, and the project as it was run.
PROVENANCE, AS_RUN = "provenance.json", "as-run.toml"
#: What only a complete result has, beside it: a page and a card of an earlier one must not stand
#: beside a later one that failed.
OUTDATED = (RESULT, "report.html", "page.json", "material.toml")
#: What run.json must hold of a folder that an older version wrote: it can be replaced only.
PARTS = "parts"
#: What of them can be told in words.
FACTS = "facts"


def usual_folder(project: Path) -> Path:
    """out/NAME below the current folder, after the project's folder and file."""
    name = project.resolve().parent.name
    return Path("out") / (name if project.stem == "project" else f"{name}-{project.stem}")


class Store:
    """A folder that holds one fit, or one series of predictions.

    run.json says whose it is; result.json is written last and taken away first, so that where it
    is, everything is complete. What is written in between (`records`, names below the folder) is
    known to whoever writes it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def used(self) -> bool:
        """Whether the folder holds anything of a fit or of predictions."""
        return (self.path / RUN).exists() or (self.path / RESULT).exists()

    def begin(
        self,
        parts: Mapping[str, str],
        resume: bool,
        overwrite: bool,
        records: Sequence[str] = (),
        facts: Facts | None = None,
    ) -> bool:
        """Make the folder ready; whether there is something to go on with.

        Parameters
        ----------
        parts : what has to be the same for going on, each part (project, data, solver, version) as
            a digest by its name; empty where every record carries a digest of its own.
        records : files below the folder that go when the folder is not gone on with.
        facts : behind the digests, in plain values: a difference is told by them.

        Raises
        ------
        OutputError : the folder cannot be written, or is used and neither `resume` nor `overwrite`
            is given.
        InputError : `resume`, but there is nothing to go on with, it is something else (named), or
            it is not readable.
        """
        if self.used and not (resume or overwrite):
            raise OutputError(
                f"{self.path}: already holds results; go on with --resume, replace them with "
                "--overwrite, or name another folder with --out"
            )
        if resume and not self.used:
            problem = "holds nothing to go on with; leave --resume out, or name another with --out"
            raise InputError(self.path, "", problem)
        if resume:
            self._check(parts, facts or {})
        remove_cut(self.path)
        with telling(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            for name in (*OUTDATED, *(() if resume else records)):
                (self.path / name).unlink(missing_ok=True)
        if not resume:
            content = {PARTS: dict(parts), FACTS: dict(facts or {})}
            self.write(RUN, json.dumps(content, indent=1) + "\n")
        return resume

    def forget(self) -> None:
        """Make a folder whose results are to be replaced one that holds nothing to go on with.

        Raises
        ------
        OutputError : it cannot be written.
        """
        with telling(self.path):
            for name in (RESULT, RUN):
                (self.path / name).unlink(missing_ok=True)

    def write(self, name: str, text: str) -> None:
        """Write a file whole or not at all.

        Raises
        ------
        OutputError : it cannot be written.
        """
        write_text(self.path / name, text)

    def finish(self, result: Mapping[str, Any]) -> None:
        """Write result.json, after everything else.

        Raises
        ------
        OutputError : it cannot be written.
        """
        self.write(RESULT, json.dumps(result, indent=1, allow_nan=False) + "\n")

    def _check(self, parts: Mapping[str, str], facts: Facts) -> None:
        path = self.path / RUN
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            before, known = content[PARTS], content.get(FACTS, {})
            other = [name for name in {**before, **parts} if before.get(name) != parts.get(name)]
            words = differences(known, facts) if other and known else []
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise InputError(path, "", "is missing or damaged; use --overwrite") from None
        if other:
            # Without words: of an older version, or what differs is in nothing that can be told.
            what = "; ".join(words) or f"another {' and '.join(sorted(other))}"
            problem = (
                f"these results are of something else: {what}"
                if words
                else (f"this folder's results are of {what}")
            )
            raise InputError(path, PARTS, f"{problem}; go on with the same, or use --overwrite")
