"""Registration of the functions that write the page, and draw the figures, of each result class."""

from importlib import import_module
from typing import Any

from ..presenting import DRAWINGS, PAGES
from ..runs.check import Check, PredictionCheck
from ..runs.folder import FailedRun, Presented
from ..runs.predictions import Predictions
from ..runs.result import Fit
from ..runs.simulation import Histories, SimulatedTests
from ..runs.verification.verify import Verification
from . import fit_page, maps, run_pages
from .vega import Drawing


def load_presenter(result: object) -> None:
    """Import the module that presents studies, if the result is one.

    The presenters of all other results are registered when this module is imported.
    """
    if isinstance(result, Presented):
        import_module(".study_pages", __package__)


def history(histories: Histories, name: str, *choices: Any) -> Drawing:
    """Return a drawing of the deformed mesh of one of several analyses.

    Parameters
    ----------
    histories : Histories
        Results of the analyses by name.
    name : str
        Name of the analysis.
    *choices
        Quantity, component and frame, as in `maps.history_charts`.
    """
    return Drawing(maps.history_charts(name, histories[name], *choices))


PAGES.register(Fit, fit_page.write_fit)
PAGES.register(FailedRun, fit_page.write_failure)
PAGES.register(Check, run_pages.write_check)
PAGES.register(Predictions, run_pages.write_predictions)
PAGES.register(SimulatedTests, run_pages.write_simulation)
PAGES.register(Verification, run_pages.write_verification)
PAGES.register(PredictionCheck, run_pages.write_prediction_check)

DRAWINGS.register(
    Fit,
    {
        "moduli": lambda fit: Drawing(fit_page.moduli(fit)),
        "optima": lambda fit: Drawing(fit_page.optima(fit)),
        "residuals": lambda fit, test: Drawing(fit_page.residuals(fit, test)),
        "of_kind": lambda fit, name, test: Drawing(fit_page.of_kind(fit, name, test)),
    },
)
DRAWINGS.register(Histories, {"history": history})
