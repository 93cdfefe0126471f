"""Share published laws, projects of the examples and command lines among the benchmarks."""

import argparse
import inspect
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.experiments.bubble import BubbleTest
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.certainty import with_certainty
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.starts import StartRecord, best_fit

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))  # no installed package has the tests
from builders.laws import TABLE_3_2, TABLE_4_2  # noqa: E402

EXAMPLES, SHARED = ROOT / "examples", ROOT.parent / "shared" / "data"
BENDING = EXAMPLES / "bend-valmex7318" / "project.toml"
THICKNESS = 0.81
#: MPa: the published pressures of the bubble.
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
#: Table 4.2 of the thesis, "solution", and Table 3.2, whose beta_0 is garbled in the scan; MPa.
LAW_4_2 = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
LAW_3_2 = HypoelasticLaw(1e3 * np.array(TABLE_3_2), strain_range=[0.153, 0.232, 0.7])


def known_project(elements=None, **fit):
    """Return the example with a known solution; `elements`: of data and fit alike."""
    project = read_project(EXAMPLES / "bubble-known-solution" / "project.toml")
    project = project.with_fit(**{"mesh_error": "told", **fit})
    if elements is None:
        return project
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest)
    data = replace(test.data, elements=elements)
    return replace(project, tests={test.name: replace(test, elements=elements, data=data)})


def known_setup(project):
    return prepare_fit(project, project.chosen(None, fitted=True))


def known_model_and_law():
    (prepared,) = known_setup(known_project()).tests
    return prepared.test.models()["bubble"], prepared.known


def objectives_of(solver, heard):
    """Return a listener of a fit that appends e of each run of the solver to `heard`."""

    def hear(record):
        if record.solver == solver:
            heard.append(np.inf if record.objective is None else record.objective)

    return hear


def settled(setup, beta, number):
    """Fit from a law on; return the problem and its best with certainty, None without a fit."""
    problem = setup.problem()
    start = problem.unknowns.at(np.asarray(beta, dtype=float))
    optimum = LevenbergMarquardt().minimise(problem, start, setup.options)
    if optimum is None:
        return None
    y, b = (tuple(v.tolist()) for v in (optimum.best.unknowns, optimum.coefficients))
    record = StartRecord(number, (0, 0), optimum.value, optimum.status, 0, y, b, 0.0)
    return problem, with_certainty(setup, problem, best_fit(problem, [record], 1e-7))


def seconds(run):
    begun = time.perf_counter()
    run()
    return time.perf_counter() - begun


def start_on(*parts):
    """Run the part that the command line names, with its arguments; without a name all of them.

    Parameters are optional arguments in their order, keyword-only ones and flags are options.
    """
    parser = argparse.ArgumentParser(
        description=parts[0].__globals__["__doc__"],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    several = parser.add_subparsers(metavar="PART") if len(parts) > 1 else None
    for part in parts:
        own, words = parser, (inspect.getdoc(part) or "").replace("%", "%%")
        if several:
            name = part.__name__.replace("_", "-")
            own = several.add_parser(name, help=words.partition("\n")[0], description=words)
        for name, parameter in inspect.signature(part).parameters.items():
            kind, default = type(parameter.default), parameter.default
            option = "--" + name.replace("_", "-")
            if parameter.kind is parameter.VAR_POSITIONAL:
                own.add_argument(name, nargs="*")
            elif kind is bool:
                own.add_argument(option, action="store_true")
            elif kind is tuple:
                own.add_argument(option, nargs="+", type=type(default[0]), default=default)
            elif parameter.kind is parameter.KEYWORD_ONLY:
                own.add_argument(option, type=kind, default=default)
            else:
                own.add_argument(name, nargs="?", type=kind, default=default)
        own.set_defaults(part=part)
    given = vars(parser.parse_args())
    chosen = given.pop("part", None)
    for part in [chosen] if chosen else parts:
        if not chosen:
            print(f"\n## {part.__name__}", flush=True)
        parameters = inspect.signature(part).parameters.values() if chosen else ()
        values = [given[p.name] for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
        values += [
            value for p in parameters if p.kind is p.VAR_POSITIONAL for value in given[p.name]
        ]
        part(*values, **{p.name: given[p.name] for p in parameters if p.kind is p.KEYWORD_ONLY})
