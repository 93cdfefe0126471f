"""The record of a run, provenance.json: project, data files, command, date, machine, versions."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..experiments.kinds import beyond_range, by_strain, files_of, strains_of, unstable_words
from ..files import __version__
from ..inference.assessment import notes_of_verdicts, pinned_by
from ..inference.misfit import notes_of_noise
from ..notes import Note, NoteKind, as_note, rows
from ..project.project import Project, plain, project_text, settings_of
from ..solvers.base import Solver
from ..writing import checksum, write_text
from .best import TAKEN_OUT, TOLD
from .folder import AS_RUN, PROVENANCE
from .setup import UNCOUNTED, FitSetup
from .starts import coarse_columns

if TYPE_CHECKING:
    from .result import Fit

PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")
#: Beyond, a test says nothing about a modulus (1 sigma, relative).
NOTHING = 1.0
#: What all tests together are called among the tests.
TOGETHER = "all together"


def versions() -> dict[str, str]:
    """Of what computes, by name."""
    of = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **of}


def result_of(fit: Fit) -> dict[str, Any]:
    """Everything that a fit found, in plain values.

    With one test its numbers also stand at the top, beside those of the fit.
    """
    project, best, law = fit.project, fit.best, fit.law
    records, sure = best.records, best.certainty
    result: dict[str, Any] = {
        "command": fit.command,
        "title": project.title,
        "solver": project.fit.solver,
        "method": project.fit.method,
        "objective": fit.objective,
        "objective_is": fit.setup.objective_is,
        "moduli": law.form.name,
        "beta": {
            "unit": project.scales.modulus_unit,
            "labels": list(law.form.labels),
            "values": (law.beta / project.scales.modulus).tolist(),
        },
        **law.form.to_card(),
        "nu12": law.nu12,
        "strain_reached": by_strain(best.reached),
        "valid_strain": by_strain(best.valid),
        "seed": project.fit.seed,
        "starts": [
            {
                "start": r.number,
                "seed": list(r.seed),
                "objective": r.objective,
                "status": r.status,
                "analyses": r.analyses,
                "external_runs": r.external_runs,
                "cached_runs": r.cached_runs,
                **({} if fit.coarse_to_fine is None else coarse_columns(r)),
            }
            for r in records
        ],
        "coarse_to_fine": None if fit.coarse_to_fine is None else fit.coarse_to_fine.to_json(),
        "analyses": sum(r.analyses for r in records),
        "external_runs": sum(r.external_runs for r in records),
        "cached_runs": sum(r.cached_runs for r in records),
        "warnings": [],
        "notes": [],
        "wall_s": fit.wall_s,
        "versions": versions(),
    }
    result["misfit"] = {
        name: {**asdict(m), "times_noise": m.ratio if m.noise > 0 else None}
        for name, m in fit.misfits.items()
    }
    result["noise_given"] = {name: test.numbers for name, test in fit.noise_tests.items()}
    if sure is not None:
        result["uncertainty"] = {
            "noise": sure.noise,
            "values_that_err_as_one": sure.alike,
            "largest_relative_sigma": {n: float(s.max()) for n, s in sure.sigma.items()},
            "median_relative_sigma": {n: float(np.median(s)) for n, s in sure.sigma.items()},
            "largest_relative_mesh": _largest(sure.mesh),
            "largest_relative_total": _largest(sure.total),
            "mesh_error": TAKEN_OUT if sure.taken_out else TOLD,
            "second_order": None if sure.order is None else sure.order.numbers,
            "smooth_beyond_noise": {
                name: {**asdict(d), "told": d.told} for name, d in sure.discrepancy.items()
            },
        }
    if fit.verdicts:
        result["unknowns"] = {verdict.name: verdict.numbers for verdict in fit.verdicts}
    if fit.record is not None:
        result["provenance"] = PROVENANCE
    result["tests"] = {name: f.numbers for name, f in fit.findings.items()}
    if len(fit.findings) == 1:
        result |= next(iter(fit.findings.values())).numbers
    else:
        result |= _together(fit)
    warnings = [note.line for note in fit.notes]
    return result | {"warnings": warnings, "notes": rows(fit.notes)}


def _largest(relative: Mapping[str, np.ndarray] | None) -> dict[str, float] | None:
    return None if relative is None else {n: float(np.abs(s).max()) for n, s in relative.items()}


def pinned(fit: Fit) -> dict[str, dict[str, np.ndarray]]:
    """1 sigma of each modulus from each test alone and from all; empty where it is not known.

    From all together as they are weighted in the fit: the very uncertainty that it reports.
    """
    point, sure = fit.best.differentiated, fit.best.certainty
    if point is None or sure is None or sure.rows is None or len(fit.setup.tests) < 2:
        return {}
    leading = fit.problem.surrogate or fit.problem
    names = [c.name for c in fit.problem.comparisons]
    numbers = {
        name: [names.index(c.name) for c in fitted.comparisons]
        for name, fitted in fit.tests.items()
    }
    sigma = partial(pinned_by, leading, point, fit.law, fit.best.valid, noise=sure.rows)
    alone = {name: sigma(numbers=own) for name, own in numbers.items()}
    return {**alone, TOGETHER: dict(sure.sigma)}


def pinned_numbers(fit: Fit) -> dict[str, dict[str, dict[str, float]]]:
    """The same along the strains: least, median and largest."""
    return {
        source: {
            name: {
                "least": float(s.min()),
                "median": float(np.median(s)),
                "largest": float(s.max()),
            }
            for name, s in sigmas.items()
        }
        for source, sigmas in fit.pinned.items()
    }


def _together(fit: Fit) -> dict[str, Any]:
    """What a fit of several tests says beside what each test says."""
    every = fit.problem.blocks.norms(fit.best.point.residual)
    block = np.concatenate(
        [np.full(len(c.objective.sizes), k) for k, c in enumerate(fit.problem.comparisons)]
    )
    norms = every[: len(block)]  # after them come the priors
    names = [c.name for c in fit.problem.comparisons]
    errors = {}
    for test, fitted in fit.tests.items():
        mine = np.isin(block, [names.index(c.name) for c in fitted.comparisons])
        errors[test] = float(norms[mine].sum() / fit.project.tests[test].weight)
    return {
        "mean_relative_error": errors,
        "weights": {name: fit.project.tests[name].weight for name in fit.tests},
        "pinned": pinned_numbers(fit),
    }


def notes_of_fit(fit: Fit, pins: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[Note]:
    """What a reader must know before using the numbers: one place for page, terminal and json.

    pins : 1 sigma of each modulus ("least", "median", "largest") by test.
    """
    best, several = fit.best, len(fit.problem.comparisons) > 1
    notes = list(best.certainty.undetermined) if best.certainty is not None else []
    notes += notes_of_verdicts(fit.verdicts)
    cut = [record for record in best.records if record.failure]
    if cut:
        said = (
            f"{len(cut)} of {len(best.records)} starts ended because {fit.project.fit.solver} "
            f"failed ({cut[0].failure}): --resume tries them again"
        )
        notes.append(Note(NoteKind.STARTS, said))
    notes += [note for judgement in fit.judgements for note in judgement.notes]
    ends = np.asarray(fit.law.strain_range)
    # What the solver that counts does not look at, the one that leads may have.
    leading = (best.differentiated or best.point).histories
    every = zip(fit.problem.comparisons, best.point.histories, leading, strict=True)
    for comparison, history, beside in every:
        unstable = beside.unstable if history.unstable is None else history.unstable
        own = [*unstable_words(unstable), *beyond_range(strains_of(history), ends)]
        own += map(as_note, history.remarks)
        notes += [note.about(comparison.name) for note in own] if several else own
    # Computed data hold no noise: that less is left than is reckoned with is as it should be.
    computed = {
        c.name
        for prepared in fit.setup.tests
        if prepared.known is not None
        for c in fit.tests[prepared.test.name].comparisons
    }
    left = [
        note
        for note in notes_of_noise(fit.noise_tests)
        if note.kind != NoteKind.BELOW_NOISE or note.of not in computed
    ]
    notes += left if several else [Note(note.kind, str(note)) for note in left]
    for name, findings in fit.findings.items():
        told = [as_note(note) for note in findings.warnings]
        notes += [note.about(name) for note in told] if len(fit.findings) > 1 else told
    notes += [
        Note(
            NoteKind.ALONE,
            f"{source} alone does not determine {name} (1 sigma above {100 * NOTHING:.0f} % "
            "everywhere)",
        )
        for source, sigmas in pins.items()
        if source != TOGETHER
        for name, s in sigmas.items()
        if s["least"] > NOTHING
    ]
    return notes


@dataclass(frozen=True, eq=False)
class Record:
    """What a folder's results came from.

    Parameters
    ----------
    project : its file, in full. text : of that file, None of a project without one. settings : as
        `written.settings_of` has them. data : a row a file, see `data_rows`. runs : when, by which
        command, on which machine, with which versions; those that were gone on with come first.
    """

    project: Path
    text: str | None
    settings: Mapping[str, Any] | None
    data: Sequence[Mapping[str, Any]]
    solver: Mapping[str, str]
    runs: Sequence[Mapping[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """Plain values: what provenance.json holds."""
        text = self.text
        digest = None if text is None else hashlib.sha256(text.encode()).hexdigest()
        as_run = None if self.settings is None else project_text(self.settings)
        return {
            "project": {
                "file": os.path.abspath(self.project),
                "sha256": digest,
                "text": text,
                "as_run": as_run,
            },
            "data": [dict(row) for row in self.data],
            "solver": dict(self.solver),
            "runs": [dict(run) for run in self.runs],
        }

    def after(self, folder: Path) -> Record:
        """The record after the runs that the folder's own has; as it is where that is damaged."""
        try:
            runs = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["runs"]
            before = [dict(run) for run in runs]
        except (OSError, ValueError, KeyError, TypeError):
            return self
        return replace(self, runs=[*before, *self.runs])

    def write(self, folder: Path) -> None:
        """Write provenance.json, and the project as it is run as a file that can be run again.

        Raises
        ------
        OutputError : they cannot be written.
        """
        content = self.to_json()
        if self.settings is not None:
            write_text(folder / AS_RUN, content["project"]["as_run"])
        write_text(folder / PROVENANCE, json.dumps(content, indent=1, ensure_ascii=False) + "\n")

    @property
    def files(self) -> list[tuple[str, str]]:
        """What it writes, and what that is."""
        project = [] if self.settings is None else [(AS_RUN, "the project as run, to run again")]
        return [(PROVENANCE, "what these results came from"), *project]


def data_rows(tests: Iterable[tuple[str, object]]) -> list[dict[str, Any]]:
    """Every measured file of tests by name, in order: checksum, what was read, rows and why not.

    Raises
    ------
    InputError : a file is not there any more.
    """
    return [
        {
            "test": name,
            "file": os.path.abspath(file.path),
            "name": file.path.name,
            "sha256": checksum(file.path),
            "format": file.source.format,
            "columns": dict(file.source.columns),
            "units": dict(file.source.units),
            "rows_used": file.used,
            "rows_dropped": dict(file.dropped),
            "notes": list(file.source.notes),
        }
        for name, test in tests
        for file in files_of(test)
    ]


def this_run(command_line: Sequence[str] | None) -> dict[str, Any]:
    """Now, here, with these versions; command_line : None where Python called."""
    return {
        "command_line": None if command_line is None else list(command_line),
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "folder": os.getcwd(),
        "machine": {
            "name": platform.node(),
            "system": platform.platform(),
            "processor": platform.machine(),
        },
        "versions": versions(),
    }


#: What a test is called and where its files lie changes nothing.
NAMES = ("name", "folder")


def facts_of(setup: FitSetup, solver: Solver, data: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Everything that a fit's starts depend on; see `differences.Facts`.

    data : the data files, as `record.data_rows` has them.
    """
    names = [test.test.name for test in setup.tests]
    files = {
        name: [{k: row[k] for k in ("name", "sha256")} for row in data if row["test"] == name]
        for name in names
    }
    return {
        "version": __version__,
        "solver": solver_facts(setup.project.fit.solver, solver.identity),
        **_said(setup.project, names),
        "files": files,
    }


def solver_facts(name: str, identity: str) -> dict[str, str]:
    """A solver's identity taken apart: "ccx 2.20; element=S8R" is its version and its element."""
    itself, *settings = identity.split("; ")
    pairs = [setting.partition("=")[::2] for setting in settings]
    return {"name": name, "version": itself, **dict(pairs)}


def _said(project: Project, names: list[str]) -> dict[str, Any]:
    written = project.written
    if written is None:  # of no file
        return {"settings": {}, "tests": {name: {} for name in names}}
    whole = settings_of(project, names)
    law = {f"law.{key}": value for key, value in whole["law"].items()}
    fit = {f"fit.{k}": v for k, v in whole["fit"].items() if k not in UNCOUNTED}
    fabric = {f"fabric.{k}": v for k, v in whole["fabric"].items() if k not in NAMES}
    units = {f"units.{key}": value for key, value in whole["units"].items()}
    return {
        "settings": {**fabric, **units, **law, **fit},
        "tests": {name: _without(written.whole[name]) for name in names},
    }


def _without(section: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without(value) if isinstance(value, Mapping) else plain(value)
        for key, value in section.items()
        if key not in NAMES
    }
