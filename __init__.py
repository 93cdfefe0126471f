"""bubblefit: test data in, validated material card of a coated fabric out.

What a notebook writes, and all that the command line calls:

    import bubblefit as bf

    project = bf.read_project("fabric.toml")
    fit = bf.fit(project, tests="bubble", starts=8)
    fit.card.write("material.toml")
    fit.moduli(), fit.residuals()
    fit.report("out")
    bf.simulate(project.tests["bubble"], fit.card)
"""

import bubblefit.interrupts  # the first one: it guards the others

# isort: split
from typing import TYPE_CHECKING, Any

# meshio.read("job.frd") and "job.t19" work in whoever imports us. By full names: pytest imports
# this file a second time, as a module without a package.
import bubblefit.lazy_modules
import bubblefit.presenting
import bubblefit.solvers.meshio_readers

from .version import __version__ as __version__

if TYPE_CHECKING:
    from .experiments.cycles.evaluation import cycles
    from .experiments.own import OwnTest
    from .experiments.sections import Fabric
    from .materials.card import MaterialCard, read_card
    from .materials.forms.spline import Form
    from .notes import BubblefitWarning
    from .project.measured import read, register
    from .project.objects import Biaxial, Bubble, Cylinder, Deck, Law, Registration, Sheet, Strips
    from .project.project import Project, read_project
    from .runs.bootstrap import bootstrap
    from .runs.check import check
    from .runs.compare import compare
    from .runs.estimate import estimate
    from .runs.fit import fit
    from .runs.plan import plan
    from .runs.predictions import predict
    from .runs.profile import profile
    from .runs.refinement import refine
    from .runs.result import Fit
    from .runs.simulation import simulate
    from .runs.validation import validate
    from .runs.verification.verify import verify
    from .runs.weight_study import weights

__all__ = [
    "Biaxial",
    "Bubble",
    "BubblefitWarning",
    "Cylinder",
    "Deck",
    "Fabric",
    "Fit",
    "Form",
    "Law",
    "MaterialCard",
    "OwnTest",
    "Project",
    "Registration",
    "Sheet",
    "Strips",
    "bootstrap",
    "check",
    "compare",
    "cycles",
    "estimate",
    "fit",
    "plan",
    "predict",
    "profile",
    "read",
    "read_card",
    "read_project",
    "refine",
    "register",
    "simulate",
    "validate",
    "verify",
    "weights",
]

#: Names by the module where they are: imported when they are asked for, so that `import bubblefit`
#: is quick.
_NAMES = {
    "experiments.cycles.evaluation": "cycles",
    "experiments.sections": "Fabric",
    "experiments.own": "OwnTest",
    "materials.card": "MaterialCard read_card",
    "materials.forms.spline": "Form",
    "notes": "BubblefitWarning",
    "project.measured": "read register",
    "project.objects": "Biaxial Bubble Cylinder Deck Law Registration Sheet Strips",
    "project.project": "Project read_project",
    "runs.bootstrap": "bootstrap",
    "runs.compare": "compare",
    "runs.estimate": "estimate",
    "runs.check": "check",
    "runs.fit": "fit",
    "runs.plan": "plan",
    "runs.predictions": "predict",
    "runs.profile": "profile",
    "runs.refinement": "refine",
    "runs.result": "Fit",
    "runs.simulation": "simulate",
    "runs.validation": "validate",
    "runs.verification.verify": "verify",
    "runs.weight_study": "weights",
}
_PLACES = {name: module for module, names in _NAMES.items() for name in names.split()}


if not TYPE_CHECKING:  # so that a type checker knows which names there are

    def __getattr__(name: str) -> Any:
        if name in _PLACES:
            from .lazy_modules import import_quickly

            return getattr(import_quickly(f"bubblefit.{_PLACES[name]}"), name)
        raise AttributeError(f"module 'bubblefit' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])


_load_presenter_of_result = bubblefit.lazy_modules.LazyFunction(
    "bubblefit.reports.results", "load_presenter"
)
bubblefit.presenting.KINDS.load = bubblefit.lazy_modules.LazyFunction(
    "bubblefit.reports.kinds", "load_presenter"
)
bubblefit.presenting.PAGES.load = _load_presenter_of_result
bubblefit.presenting.DRAWINGS.load = _load_presenter_of_result
