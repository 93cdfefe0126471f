"""What a biaxial test puts on the page of a fit, and the files that it writes."""

from __future__ import annotations

from collections.abc import Sequence

from ...materials.law import HypoelasticLaw
from ...reports import BiaxialPanel, plot_biaxial
from ...reports.biaxial_charts import biaxial_charts
from ...writing import replacing
from ..exhibit import Exhibit, Output
from .objective import PERCENT
from .prepared import FittedPath
from .tables import misfit_table, path_table
from .test import BiaxialTest

CAPTION = "Strain over the larger load: measured and modelled"


def exhibit(
    test: BiaxialTest, paths: Sequence[FittedPath], law: HypoelasticLaw, out: Output
) -> Exhibit:
    """Write paths.csv and the picture of the ratios."""
    with replacing(out.path("paths.csv")) as path:
        path_table(paths).to_csv(path, index=False, float_format="%.9g")
    panels = [
        BiaxialPanel(
            p.path.ratio,
            p.path.load.max(axis=1),
            PERCENT * p.objective.strain,
            (("model", p.path.load.max(axis=1), PERCENT * p.objective.modelled(p.history)),),
        )
        for p in paths
    ]
    plot_biaxial(out.path("paths.png"), panels)
    return Exhibit(
        facts=[("ratios matched", ", ".join(p.path.ratio for p in paths))],
        tables=[misfit_table(paths)],
        files=[
            (out.name("paths.csv"), "loads and strains of every ratio, measured and modelled"),
            (out.name("paths.png"), "picture of the ratios"),
        ],
        parts=[biaxial_charts(f"{test.name} ratios", panels, CAPTION)],
    )
