"""The result of a fit: card, tables, numbers, and the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..experiments.kinds import (
    Findings,
    FittedTest,
    Judgement,
    Output,
    PreparedTest,
    beyond_range,
    by_strain,
    strains_of,
    unstable_words,
)
from ..experiments.registry import report_of
from ..files import __version__
from ..inference.assessment import Verdict, notes_of_verdicts, uncertainty_from, verdicts
from ..inference.noise import Misfit, NoiseTest, misfits, noise_tests, notes_of_noise
from ..inference.posterior import Posterior
from ..inference.problem import FitProblem
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, as_note, rows
from ..project.project import Project
from .best import TAKEN_OUT, TOLD, BestFit, card_certainty
from .folder import PROVENANCE
from .presenters import write_report
from .record import Record, versions
from .setup import CoarseToFine, FitSetup
from .starts import coarse_columns

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

#: Laws of the best starts that are drawn together.
BEST = 5
#: What `Fit.write_table` writes.
TABLES = ("residuals", "moduli", "coefficients", "starts")
#: What every row of the residuals ends with.
COMPARED = ("quantity", "measured", "modelled", "difference", "unit")
#: Strains at which `Fit.moduli` lists the moduli.
PLACES = 61


@dataclass(frozen=True, eq=False)
class Fit:
    """What a fit found.

    Parameters
    ----------
    setup : project, law without coefficients, tests with their data.
    best : the best of the starts, run once more from the unloaded state. wall_s : seconds.
    record : what it came from, None where nobody asks.
    judgements : what was doubtful in the data.
    """

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    wall_s: float
    record: Record | None = None
    judgements: tuple[Judgement, ...] = ()

    @property
    def project(self) -> Project:
        """The project as it was fitted, options of the call included."""
        return self.setup.project

    @property
    def objective(self) -> float:
        """What is left of the objective (`FitSetup.objective_is`) at the best fit."""
        return self.best.objective

    @property
    def law(self) -> HypoelasticLaw:
        """The best law, over the whole strain range that it was fitted with."""
        return self.best.law

    @property
    def command(self) -> str:
        """The kind of the tests where there is one, else "fit": for result.json and the card."""
        kinds = {t.test.kind for t in self.setup.tests}
        return kinds.pop() if len(kinds) == 1 else "fit"

    @cached_property
    def card(self) -> MaterialCard:
        """The material card; valid for the strains that the tests reached."""
        quality = ", ".join(
            f"{name}: {f.quality}" if len(self.findings) > 1 else f.quality
            for name, f in self.findings.items()
        )
        source = (
            f"bubblefit {__version__} {self.command}, {self.project.path.name}, objective "
            f"{self.objective:.4g}, {quality}"
        )
        if self.best.certainty is not None and self.best.certainty.taken_out:
            source += ", error of the mesh taken out"
        law = replace(self.law, strain_range=self.best.valid)
        sure = card_certainty(self.problem, self.best, law, list(self.tests))
        return MaterialCard(law, self.thickness, self.project.title, source, sure)

    @property
    def thickness(self) -> float:
        """mm before the test: the fabric's, or as it was fitted."""
        places = {n.name: k for k, n in enumerate(self.problem.unknowns.nuisance.shared)}
        if "thickness" not in places:
            return self.project.fabric.thickness
        known = self.best.point.unknowns if self._known is None else self._known.best
        return float(known[self.problem.unknowns.size + places["thickness"]])

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """What the data say of every unknown beside the moduli; empty where it is not known."""
        known = self._known
        return () if known is None else verdicts(known, self.best.valid)

    @property
    def _known(self) -> Posterior | None:
        """Of the law that is reported."""
        return None if self.best.certainty is None else self.best.certainty.reported

    @cached_property
    def tests(self) -> dict[str, FittedTest]:
        """Every test in the light of the fit, by name."""
        return {t.test.name: self._fitted(t) for t in self.setup.tests}

    @cached_property
    def findings(self) -> dict[str, Findings]:
        """What the fit means for every test, by name."""
        return {
            t.test.name: report_of(t.test.kind).findings(t, self.tests[t.test.name])
            for t in self.setup.tests
        }

    @cached_property
    def result(self) -> dict[str, Any]:
        """Everything in plain values: what result.json holds."""

        return result_of(self)

    @cached_property
    def misfits(self) -> dict[str, Misfit]:
        """What is left of every comparison beside the noise of its data, by name."""
        return misfits(self.problem, self.best.point.residual)

    @cached_property
    def noise_tests(self) -> dict[str, NoiseTest]:
        """The same beside what chance leaves of noise, of comparisons whose noise is given."""
        return noise_tests(self.problem, self.best.point.residual)

    @cached_property
    def notes(self) -> list[Note]:
        """What a reader must know before using the numbers: as everywhere that the fit is told."""

        return notes_of_fit(self, pinned_numbers(self))

    @cached_property
    def pinned(self) -> dict[str, dict[str, Array]]:
        """(n,) 1 sigma of each modulus along its strains, from each test alone and from all."""

        return pinned(self)

    @cached_property
    def coarse_to_fine(self) -> CoarseToFine | None:
        """What ran on which mesh; None where every start ran on its own."""
        return CoarseToFine.of(self.setup, self.best.records)

    @property
    def stages(self) -> str:
        """The same in a line; empty where nobody asked for it."""
        if self.coarse_to_fine is not None:
            return self.coarse_to_fine.words
        asked = self.project.fit.coarse_to_fine
        return "no test has a coarser mesh: every start ran on the full one" if asked else ""

    def moduli(self) -> pd.DataFrame:
        """E1, E2 and G12 (MPa) along their strains, with one standard deviation.

        Columns modulus, strain, MPa, the ends of its band, lower_MPa and upper_MPa (95 %, noise and
        mesh together), sigma_relative, and what it is made of: noise_relative, mesh_relative (by
        how much the modulus would be another on ever finer meshes than on that of the fit). NaN
        where it is not known; sigma is that of the noise alone where the mesh's part is not known.
        """
        import pandas as pd

        sure, rows = self.best.certainty, []
        for name, component in COMPONENTS.items():
            strain = np.linspace(0.0, self.best.valid[component], PLACES)
            sigma = noise = mesh = lower = upper = np.full(PLACES, np.nan)
            if sure is not None:
                at = sure.strain[name]
                sigma, noise = (np.interp(strain, at, s[name]) for s in (sure.total, sure.sigma))
                if name in sure.band:
                    lower, upper = (np.interp(strain, at, end) for end in sure.band[name])
                if sure.mesh is not None:
                    mesh = np.interp(strain, at, sure.mesh[name])
            rows.append(
                pd.DataFrame(
                    {
                        "modulus": name,
                        "strain": strain,
                        "MPa": self.law.modulus(name, strain),
                        "lower_MPa": lower,
                        "upper_MPa": upper,
                        "sigma_relative": sigma,
                        "noise_relative": noise,
                        "mesh_relative": mesh,
                    }
                )
            )
        return pd.concat(rows, ignore_index=True)

    def coefficients(self) -> pd.DataFrame:
        """Every unknown: value, one standard deviation, bounds, correlations with the others.

        Columns unknown, unit, value, sigma, lower_bound, upper_bound, and one by the name of each
        unknown.
        """

        return coefficients_of(self)

    def residuals(self) -> pd.DataFrame:
        """Every matched value of every test, a row each.

        Columns test, part, where it is (of a bubble frame, pressure_kPa, x_mm, y_mm; of a strip
        elongation_mm; of a biaxial test the loads), quantity, measured, modelled, difference
        (modelled less measured) and the unit of these three.
        """
        import pandas as pd

        frames = []
        for prepared in self.setup.tests:
            name = prepared.test.name
            table = report_of(prepared.test.kind).residuals(prepared, self.tests[name])
            table.insert(0, "test", name)
            frames.append(table)
        every = pd.concat(frames, ignore_index=True)
        return every[[name for name in every if name not in COMPARED] + list(COMPARED)]

    def write_table(self, path: Path | str, table: str = "residuals") -> Path:
        """Write one of the tables as .csv or .parquet, by the ending of the file's name.

        Parameters
        ----------
        table : "residuals", "moduli", "coefficients" or "starts". Parquet needs pyarrow: pip
            install 'bubblefit[parquet]'.

        Raises
        ------
        InputError : another table or ending, or pyarrow is not there. OutputError : the file cannot
            be written.
        """
        from .folder import write_table

        if table not in TABLES:
            raise InputError(None, "table", f"{table!r} is not one of: {', '.join(TABLES)}")
        return write_table(getattr(self, table)(), path)

    def starts(self) -> pd.DataFrame:
        """How every start ended: start, objective, status, analyses, external_runs,
        cached_runs, seconds.

        Of starts that ran coarse to fine also coarse_objective and coarse_analyses, on the coarse
        mesh, and same_as, the start that had the same optimum there and alone went on.
        """
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "start": r.number,
                    "objective": np.nan if r.objective is None else r.objective,
                    "status": r.status,
                    "analyses": r.analyses,
                    "external_runs": r.external_runs,
                    "cached_runs": r.cached_runs,
                    "seconds": r.wall_s,
                    **({} if self.coarse_to_fine is None else coarse_columns(r)),
                }
                for r in self.best.records
            ]
        )

    @property
    def laws(self) -> list[HypoelasticLaw]:
        """The laws of the best starts that have a fit of their own, best first."""
        unknowns = self.problem.unknowns
        own = [r for r in self.best.ranked[1:] if r.same_as is None]
        others = [np.array(r.unknowns) for r in own[: BEST - 1]]
        return [self.law, *(unknowns.law(self.law, y) for y in others)]

    def report(self, folder: Path | str) -> Path:
        """Write the card, tables, figures, report.html and, last, result.json into a folder.

        Returns
        -------
        The page.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        return write_report(self, folder)

    def output(self, folder: Path, test: str) -> Output:
        """Where a test writes: with its name before every file's where there are several."""
        return Output.of(folder, test, len(self.setup.tests) > 1)

    def _fitted(self, prepared: PreparedTest) -> FittedTest:
        best = self.best
        own = {c.name for c in self.setup.own(prepared)}
        names = [c.name for c in self.problem.comparisons]
        mine = [k for k, name in enumerate(names) if name in own]
        unknowns, y = self.problem.unknowns, best.point.unknowns
        return FittedTest(
            self.setup.own(prepared),
            tuple(best.point.histories[k] for k in mine),
            {n: v for k in mine for n, v in unknowns.nuisance_values(names[k], y).items()},
            self.law,
            self.laws,
            best.reached,
            best.valid,
            best.certainty,
        )


#: Logarithmic strains at which moduli are told, and the end of the valid strains beside them.
STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
#: Of the end: a strain nearer to it is left out, the end stands for it.
NEAR = 0.95


@dataclass(frozen=True)
class Answer:
    """One modulus at one strain.

    strain : logarithmic. value : MPa; per_width : the same times the thickness before the test,
    kN/m. sigma : one standard deviation over the value; band : MPa, between which it lies with 95 %
    certainty; None where they are not known. end : whether the modulus is fitted no further.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    sigma: float | None = None
    band: tuple[float, float] | None = None
    end: bool = False


def answers(fit: Fit) -> list[Answer]:
    """E1, E2 and G12 at a few strains up to the end of those that they are fitted for."""
    told = []
    for name, component in COMPONENTS.items():
        end = float(fit.best.valid[component])
        strains = [*(strain for strain in STRAINS if strain < NEAR * end), end]
        told += [answer_at(fit, name, strain, strain == end) for strain in strains]
    return told


def answer_at(fit: Fit, name: str, strain: float, end: bool = False) -> Answer:
    """One modulus (E1, E2 or G12) at one strain."""
    value, sure = float(fit.law.modulus(name, strain)), fit.best.certainty
    per_width = value * fit.thickness
    if sure is None:
        return Answer(name, strain, value, per_width, end=end)

    def at(values: np.ndarray) -> float:
        return float(np.interp(strain, sure.strain[name], values))

    band = None
    if name in sure.band:
        lower, upper = sure.band[name]
        band = at(lower), at(upper)
    return Answer(name, strain, value, per_width, at(sure.total[name]), band, end)


#: The columns before those of the correlations.
COLUMNS = ("unknown", "unit", "value", "sigma", "lower_bound", "upper_bound")


def coefficients_of(fit: Fit) -> pd.DataFrame:
    """Coefficients of the law in the project's unit, then the nuisance.

    Columns unknown, unit, value, sigma (one standard deviation by noise, bounds left aside),
    lower_bound, upper_bound, and of each unknown, under its name, the correlation with it. NaN
    where it is not known.
    """
    import pandas as pd

    unknowns, sure, scales = fit.problem.unknowns, fit.best.certainty, fit.project.scales
    size, nuisance = unknowns.size, unknowns.nuisance.all
    names = [*unknowns.labels, *unknowns.nuisance_names]
    scale = np.array([scales.modulus] * size + [1.0] * len(nuisance))
    known = None if sure is None else sure.reported
    y = fit.best.point.unknowns if known is None else known.best
    values = np.concatenate([fit.law.beta[list(unknowns.free)], y[size:]]) / scale
    ends = [
        np.concatenate([own, other]) / scale
        for own, other in zip(unknowns.box, unknowns.nuisance.bounds, strict=True)
    ]
    sigma, correlations = np.full(len(names), np.nan), np.full((len(names), len(names)), np.nan)
    if known is not None:
        sigma = np.sqrt(np.diag(known.coefficients)) / scale
        correlations = known.correlations
    units = [scales.modulus_unit] * size + [n.unit for n in nuisance]
    table = pd.DataFrame(dict(zip(COLUMNS, (names, units, values, sigma, *ends), strict=True)))
    return pd.concat([table, pd.DataFrame(correlations, columns=names)], axis=1)


#: Beyond, a test says nothing about a modulus (1 sigma, relative).
NOTHING = 1.0


#: What all tests together are called among the tests.
TOGETHER = "all together"


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
                name: {**asdict(d), "told": d.significant} for name, d in sure.discrepancy.items()
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
    sigma = partial(uncertainty_from, leading, point, fit.law, fit.best.valid, noise=sure.rows)
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
