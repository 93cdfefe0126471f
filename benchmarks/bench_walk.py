"""List the modules that a bubble test passes, from its project file to the report.

Of the example with a known solution, coarse, one start, one process: each module in which a
function is called, in the order of their first calls (benchmarks/walk.md), with its job.
"""

import ast
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import bubblefit as bf
from bubblefit.runs.certainty import with_certainty
from bubblefit.runs.folder import Provenance
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.starts import best_fit, run_start
from common import EXAMPLES, start_on

ROOT = Path(bf.__file__).resolve().parent
KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"


@contextmanager
def entered(steps, step):
    """Append each module to its first step when one of its functions is called."""
    known, modules = {}, steps.setdefault(step, [])

    def watch(frame, event, _):
        code = frame.f_code
        if event != "call" or code.co_name == "<module>":
            return
        if code.co_filename not in known:
            path = Path(code.co_filename).resolve()
            inside = path.is_file() and path.is_relative_to(ROOT)
            inside = inside and path.parent != ROOT / "benchmarks"
            known[code.co_filename] = str(path.relative_to(ROOT)) if inside else None
        name = known[code.co_filename]
        if name is not None and not any(name in own for own in steps.values()):
            modules.append(name)

    sys.setprofile(watch)
    try:
        yield
    finally:
        sys.setprofile(None)


def walk():
    """Return modules by step, each where it is entered first."""
    steps = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "project.toml"
        path.write_text(KNOWN.read_text().replace("elements = 800", "elements = 48"))
        with entered(steps, "read the project"):
            project = bf.read_project(path)
        with entered(steps, "prepare the tests"):
            setup = prepare_fit(project, project.chosen(None, fitted=True))
        with entered(steps, "fit from one start"):
            problem = setup.problem()
            record = run_start(problem, setup.options, project.fit.seed, 0, lambda _: None)
        with entered(steps, "assess the best"):
            best = best_fit(problem, [record], project.fit.tolerance)
            record = Provenance.of(project, None, [], problem.solver, None)
            fit = Fit(setup, problem, with_certainty(setup, problem, best), 0.0, record)
            _ = fit.card, fit.findings
        with entered(steps, "write the report"):
            fit.report(Path(folder) / "out")
    return steps


def job(module):
    """Return the first line of a module's docstring, or what a template is."""
    if not module.endswith(".py"):
        return "a template"
    return (ast.get_docstring(ast.parse((ROOT / module).read_text("utf-8"))) or "").split("\n")[0]


def main(*, names=False):
    """Print steps with their numbers of modules; with --names their names and jobs."""
    walk()  # imports everything: what they run is no part of the walk
    steps = walk()
    for name, modules in steps.items():
        print(f"{name:20s} {len(modules):3d}")
        if names:
            for module in modules:
                print(f"    {module:44s} {job(module)}")
    print(f"{'modules in all':20s} {sum(map(len, steps.values())):3d}")


if __name__ == "__main__":
    start_on(main)
