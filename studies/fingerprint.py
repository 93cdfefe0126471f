"""Whose study an output folder holds: settings, data and version, in one number."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from .. import __version__
from ..identification.problem import FitProblem
from ..projects.fit import FitProject
from ..solvers.base import Solver

# Where the files lie, how many starts there are and what they are called changes no result.
FREE = {"path", "title", "starts", "data", "solver_options"}
# Of CalculiX' options, what does (Marc says more itself); of a plug-in's any may.
DECK = ("element", "templates")


def fingerprint(project: FitProject, problem: FitProblem) -> str:
    """SHA-256 over everything that a start's result depends on."""
    digest = hashlib.sha256(__version__.encode())
    for setting in _settings(project):
        digest.update(setting.encode())
    options = project.solver_options.get(project.solver, {})
    digest.update(solver_words(problem.solver, options).encode())
    for experiment in problem.experiments:
        for data in experiment.objective.data:
            digest.update(np.ascontiguousarray(data).tobytes())
    return digest.hexdigest()


def solver_words(solver: Solver, options: Mapping[str, Any]) -> str:
    """What of a solver and its options a result depends on."""
    ours = solver.name in ("calculix", "marc")
    names = DECK if ours else sorted({*DECK, *options})
    words = "".join(f"{name}={options.get(name)};" for name in names)
    # A solver whose settings are not all in the project says itself what it is.
    return words + str(getattr(solver, "identity", ""))


def _settings(project: FitProject) -> Iterator[str]:
    for field in fields(project):
        value = getattr(project, field.name)
        if isinstance(value, FitProject):  # a part of a joint fit
            yield from (f"{field.name}.{setting}" for setting in _settings(value))
        elif field.name == "strips":  # their loads are hashed as data, their lengths are the model
            for direction, strip in value.items():
                yield f"{direction}={strip.gauge_length!r},{strip.final_length!r};"
        elif field.name not in FREE:
            yield f"{field.name}={_plain(value)};"


def _plain(value: object) -> str:
    return repr(value.tolist()) if isinstance(value, np.ndarray) else repr(value)
