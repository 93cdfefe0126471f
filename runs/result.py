"""The result of a fit: card, tables, numbers of result.json, notes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import NotNegative, checked_arguments
from ..errors import InputError, check_one_of
from ..experiments.doubts import Judgement
from ..experiments.fitted import Findings, FittedTest
from ..experiments.presenter import presenter_of
from ..experiments.run_records import unstable_words
from ..experiments.states import notes_of_states, state_of
from ..experiments.strains import BEYOND_LAW, WIDER, by_strain, notes_beyond, strains_of
from ..inference.assessment import NuisanceVerdict, moduli_from, notes_of_verdicts, verdicts
from ..inference.noise import (
    BELOW_NOISE,
    Misfit,
    NoiseTest,
    misfits,
    noise_tests,
    notes_of_misfits,
    notes_of_noise,
)
from ..inference.posterior import Posterior
from ..inference.problem import ANALYSES_USED_UP, FitProblem
from ..inference.reported import BOUND_MARK, LEVEL, ReportedModulus, sigma_words
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, as_note, note_records
from ..project.project import Project
from ..version import __version__
from ..wording import html_table
from .best import CORRECTED, TOLD, BestFit, card_certainty
from .folder import PROVENANCE, Provenance, Reported, draw, versions, write_table
from .held_out import HeldOut, held_out
from .setup import FitSetup, coarse_to_fine
from .simulation import Histories
from .verdict import NOT_CONVERGED, FitVerdict, verdict_of

STARTS = NoteKind("starts that failed", weight=2)
ALONE = NoteKind("undetermined alone", weight=1)
#: Number of best starts of which the laws are drawn together.
BEST = 5
#: Tables of `Fit.write_table`.
TABLES = ("residuals", "moduli", "coefficients", "starts")
#: Numbers of a start that are also summed.
COUNTED = ("analyses", "external_runs", "cached_runs")
#: Columns of a start that ran coarse to fine.
COARSE = ("coarse_objective", "coarse_analyses", "same_as")
#: Last columns of the residuals.
COMPARED = ("quantity", "measured", "modelled", "difference", "unit")
#: Number of strains of each modulus in `Fit.moduli`, and its columns of what is known of it.
PLACES = 61
UNCERTAINTY = ("lower_MPa", "upper_MPa", "sigma_relative", "noise_relative", "mesh_relative")
FLAGS = ("at_lower_bound", "at_upper_bound", "determined")


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Reported):
    """The result of a fit; best : of the starts, run once more from the unloaded state.

    agreement : words on whether starts ended in one optimum.
    """

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    wall_s: float
    record: Provenance
    judgements: tuple[Judgement, ...] = ()
    agreement: str = ""

    @property
    def project(self) -> Project:
        """Return the project as it was fitted, options of the call included."""
        return self.setup.project

    @property
    def objective(self) -> float:
        """Return the objective (`FitSetup.objective_is`) of the best fit."""
        return self.best.point.value

    @property
    def law(self) -> HypoelasticLaw:
        """Return the best law, over the whole strain range of the fit."""
        return self.best.law

    @property
    def command(self) -> str:
        """Return the kind of the tests where they have one, else "fit"."""
        kinds = {t.test.kind for t in self.setup.tests}
        return kinds.pop() if len(kinds) == 1 else "fit"

    @cached_property
    def card(self) -> MaterialCard:
        """Return the material card, valid for the strains that the tests reached."""
        several = "{0}: {1}" if len(self.findings) > 1 else "{1}"
        quality = ", ".join(several.format(n, f.quality) for n, f in self.findings.items())
        source = f"bubblefit {__version__} {self.command}, {self.project.path.name}, objective "
        source += f"{self.objective:.4g}, {quality}"
        if self.best.certainty is not None and self.best.certainty.taken_out:
            source += ", error of the mesh taken out"
        law = replace(self.law, strain_range=self.best.valid)
        sure = card_certainty(self.problem, self.best, law, list(self.tests))
        state = state_of([prepared.test for prepared in self.setup.tests])
        return MaterialCard(law, self.thickness, self.project.title, source, sure, state)

    @property
    def thickness(self) -> float:
        """Return the thickness before the test (mm): the fabric's, or as fitted."""
        places = {n.name: k for k, n in enumerate(self.problem.unknowns.nuisance.shared)}
        if "thickness" not in places:
            return self.project.fabric.thickness
        known = self.best.point.unknowns if self._known is None else self._known.best
        return float(known[self.problem.unknowns.size + places["thickness"]])

    @cached_property
    def verdicts(self) -> tuple[NuisanceVerdict, ...]:
        """Return what the data say of each unknown beside the moduli; empty if not known."""
        known = self._known
        return () if known is None else verdicts(known, self.best.valid)

    @property
    def _known(self) -> Posterior | None:
        """Return the posterior of the reported law."""
        return None if self.best.certainty is None else self.best.certainty.reported

    @cached_property
    def tests(self) -> dict[str, FittedTest]:
        best = self.best
        unknowns = self.problem.unknowns
        fitted = {}
        names = [c.name for c in self.problem.comparisons]
        y = best.point.unknowns
        for prepared in self.setup.tests:
            own = self.setup.own(prepared)
            mine = [names.index(c.name) for c in own]
            histories = tuple(best.point.histories[k] for k in mine)
            each = (unknowns.nuisance_values(names[k], y) for k in mine)
            nuisance = {name: value for of_one in each for name, value in of_one.items()}
            fitted[prepared.test.name] = FittedTest(
                own,
                histories,
                nuisance,
                self.law,
                self.laws,
                best.reached,
                best.valid,
                best.certainty,
            )
        return fitted

    @cached_property
    def findings(self) -> dict[str, Findings]:
        return {
            t.test.name: presenter_of(t.test.kind).findings(t, self.tests[t.test.name])
            for t in self.setup.tests
        }

    @cached_property
    def result(self) -> dict[str, Any]:
        return result_of(self)

    @cached_property
    def misfits(self) -> dict[str, Misfit]:
        """Return residual and noise of each comparison by name."""
        return misfits(self.problem, self.best.point.residual)

    @cached_property
    def noise_tests(self) -> dict[str, NoiseTest]:
        """Return tests of the residual against the noise, of comparisons whose noise is given."""
        return noise_tests(self.problem, self.best.point.residual)

    @cached_property
    def notes(self) -> list[Note]:
        """Return what a reader must know before using the numbers."""
        return notes_of_fit(self, pinned_numbers(self))

    @cached_property
    def predicted(self) -> dict[str, HeldOut]:
        """Return the errors of the law, with its card's strains, at the tests of weight 0."""
        law = replace(self.law, strain_range=self.best.valid)
        return {
            prepared.test.name: held_out(prepared, law, self.setup.make_solver)
            for prepared in self.setup.predicted
        }

    @cached_property
    def verdict(self) -> FitVerdict:
        """Return whether the moduli are to be used, why not, and what is next."""
        unknowns = self.problem.unknowns
        moduli, lower, upper = unknowns.form.modulus_of, *unknowns.box
        ends = zip(moduli, lower, upper, strict=True)
        fitted = {name for name, low, high in ends if high > low}
        names = [comparison.name for comparison in self.problem.comparisons]
        return verdict_of(self.best, self.notes, names, fitted)

    @cached_property
    def pinned(self) -> dict[str, dict[str, ReportedModulus]]:
        """Return what each test alone determines of each modulus, and all of them, as reported.
        Empty if not known, or of one test."""
        point = self.best.differentiated
        sure = self.best.certainty
        if point is None or sure is None or len(self.setup.tests) < 2:
            return {}
        leading = self.problem.surrogate or self.problem
        names = [c.name for c in self.problem.comparisons]
        numbers = {
            name: [names.index(c.name) for c in fitted.comparisons]
            for name, fitted in self.tests.items()
        }
        given = leading, point, sure.reported, self.law, sure.strain
        alone = {
            name: moduli_from(*given, own, sure.noise.residual_sigma)
            for name, own in numbers.items()
        }
        return {**alone, TOGETHER: sure.moduli}

    @cached_property
    def coarse_to_fine(self) -> dict[str, Any] | None:
        """Return what ran on which mesh; None if all starts ran on the full one."""
        return coarse_to_fine(self.setup, self.best.records)

    @property
    def stages(self) -> str:
        """Return `coarse_to_fine` as a line; empty unless starts ran so, or were to."""
        if (ran := self.coarse_to_fine) is None:
            asked = self.project.fit.coarse_to_fine
            return "no test has a coarser mesh: every start ran on the full one" if asked else ""
        meshes = [f"{n} {own['coarse']} of {own['full']} quads" for n, own in ran["quads"].items()]
        return (
            f"{ran['starts']} starts on the coarse mesh ({', '.join(meshes)}; "
            f"{ran['coarse_analyses']} analyses); {ran['distinct']} of them, one of each distinct "
            f"optimum, continued on the full one ({ran['full_analyses']}), the others take its fit"
        )

    def moduli(self) -> pd.DataFrame:
        """Return E1, E2 and G12 along their strains with band and standard deviation.

        lower_MPa, upper_MPa: 95 %, noise and mesh together; at_lower_bound, at_upper_bound: a bound
        of the fit ends the band there; sigma_relative: half of its 68 % part over the modulus, of
        which noise_relative is the noise's; mesh_relative: the change on ever finer meshes. NaN
        where not known.
        """
        sure = self.best.certainty
        rows = []
        for name, component in COMPONENTS.items():
            strain = np.linspace(0.0, self.best.valid[component], PLACES)
            columns = {"modulus": name, "strain": strain, "MPa": self.law.modulus(name, strain)}
            columns |= dict.fromkeys(UNCERTAINTY, np.full(PLACES, np.nan))
            columns |= dict.fromkeys(FLAGS, np.zeros(PLACES, dtype=bool))
            if sure is not None:
                modulus = sure.at(self.law, name, strain)
                columns |= {
                    "lower_MPa": modulus.lower,
                    "upper_MPa": modulus.upper,
                    "sigma_relative": modulus.sigma,
                    "noise_relative": np.interp(strain, sure.strain[name], sure.noise_sigma[name]),
                    "at_lower_bound": modulus.at_lower_bound,
                    "at_upper_bound": modulus.at_upper_bound,
                    "determined": modulus.determined,
                }
                if sure.mesh is not None:
                    columns["mesh_relative"] = np.interp(strain, sure.strain[name], sure.mesh[name])
            rows.append(pd.DataFrame(columns))
        return pd.concat(rows, ignore_index=True)

    def bands(self) -> pd.DataFrame:
        """Return the 95 % band of `moduli`: modulus, strain, lower_MPa, upper_MPa."""
        return self.moduli()[["modulus", "strain", "lower_MPa", "upper_MPa"]]

    @checked_arguments
    def draw_laws(self, count: NotNegative = 100, *, seed: NotNegative = 0) -> list[HypoelasticLaw]:
        """Return random laws that agree with the data: 95 % of them lie within the band.

        The same seed draws the same laws. InputError : the fit has no uncertainty to draw from.
        """
        if (sure := self.best.certainty) is None:
            problem = "the solver gives no derivatives, so that nothing is known to draw from"
            raise InputError(self.project.path, "draw_laws", problem)
        known = sure.fine or sure.posterior
        return known.laws(self.law, count, np.random.default_rng(seed))

    def history(self) -> Histories:
        """Return the analyses of the best fit by name of the comparison, on the mesh of the fit."""
        unknowns = self.problem.unknowns
        y = self.best.point.unknowns
        law = unknowns.law(self.problem.law, y)
        pairs = zip(self.problem.comparisons, self.best.point.histories, strict=True)
        return Histories(
            {
                c.name: replace(h, model=c.model_at(unknowns.nuisance_values(c.name, y)), law=law)
                for c, h in pairs
            }
        )

    def plot_moduli(self) -> Any:
        """Return a drawing of the moduli with their bands, as on the page.

        A notebook shows it; `save("moduli.png")` (.svg, .pdf) writes it, and `spec` is Vega's
        specification. The charts are Vega's: into axes of matplotlib draw the columns of `moduli`.
        """
        return draw(self, "moduli")

    def plot_starts(self) -> Any:
        """Return a drawing of the optima of all starts, as `plot_moduli`."""
        return draw(self, "optima")

    def plot_residuals(self, test: str | None = None) -> Any:
        """Return a drawing of modelled less measured values of a test, or of all."""
        return draw(self, "residuals", test)

    def plot_loads(self, test: str | None = None) -> Any:
        """Return a drawing of measured and modelled load curves, of the first test that has any."""
        return draw(self, "of_kind", "loads", test)

    def plot_heights(self, test: str | None = None) -> Any:
        """Return a drawing of cuts through a bubble, measured and modelled."""
        return draw(self, "of_kind", "heights", test)

    def plot_history(self, name: str | None = None, **look: Any) -> Any:
        """Return a drawing of one of `history`, as `Histories.plot`."""
        return self.history().plot(name, **look)

    def __repr__(self) -> str:
        return f"<Fit of {', '.join(self.tests)}: objective {self.objective:.4g}>"

    def _repr_html_(self) -> str:
        rows = [
            [
                a.modulus,
                f"{100 * a.strain:.3g} %",
                f"{a.value:.4g}",
                a.band_words,
                f"{a.per_width:.4g}",
            ]
            for a in answers(self.best, self.thickness)
        ]
        words = f"{self.project.title}: {', '.join(self.tests)}, objective {self.objective:.4g}, "
        words += f"best of {len(self.best.ranked)} starts, {len(self.notes)} notes"
        return html_table(words, ["", "strain", "MPa", f"{LEVEL:.0%} band", "kN/m"], rows)

    def coefficients(self) -> pd.DataFrame:
        """Return a row an unknown: coefficients in the project's unit, then the nuisance.
        `COLUMNS` (sigma by noise, bounds left aside), then correlations. NaN where not known."""
        unknowns = self.problem.unknowns
        sure = self.best.certainty
        scales = self.project.scales
        size = unknowns.size
        nuisance = unknowns.nuisance.all
        names = [*unknowns.labels, *unknowns.nuisance.names]
        scale = np.array([scales.modulus] * size + [1.0] * len(nuisance))
        known = None if sure is None else sure.reported
        y = self.best.point.unknowns if known is None else known.best
        values = np.concatenate([self.law.beta[list(unknowns.free)], y[size:]]) / scale
        every = zip(unknowns.box, unknowns.nuisance.bounds, strict=True)
        ends = [np.concatenate(own) / scale for own in every]
        sigma = np.full(len(names), np.nan)
        correlations = np.full((len(names), len(names)), np.nan)
        if known is not None:
            sigma = np.sqrt(np.diag(known.coefficients)) / scale
            correlations = known.correlations
        units = [scales.modulus_unit] * size + [n.unit for n in nuisance]
        table = pd.DataFrame(dict(zip(COLUMNS, (names, units, values, sigma, *ends), strict=True)))
        return pd.concat([table, pd.DataFrame(correlations, columns=names)], axis=1)

    def residuals(self) -> pd.DataFrame:
        """Return a row a matched value: test, part, place, then `COMPARED`, modelled - measured."""
        frames = []
        for prepared in self.setup.tests:
            name = prepared.test.name
            table = presenter_of(prepared.test.kind).residuals(prepared, self.tests[name])
            table.insert(0, "test", name)
            frames.append(table)
        every = pd.concat(frames, ignore_index=True)
        return every[[name for name in every if name not in COMPARED] + list(COMPARED)]

    @checked_arguments
    def write_table(self, path: Path | str, table: str = "residuals") -> Path:
        """Write one of `TABLES`, as `folder.write_table`; InputError : another table."""
        check_one_of(table, TABLES, "table")
        return write_table(getattr(self, table)(), path)

    def starts(self) -> pd.DataFrame:
        """Return a row a start: objective, status, analyses, runs, seconds, coarse to fine."""
        table = pd.DataFrame(start_rows(self)).astype({"objective": float})
        table.insert(4 + len(COUNTED), "seconds", [r.wall_s for r in self.best.records])
        return table.drop(columns="seed")

    @property
    def laws(self) -> list[HypoelasticLaw]:
        """Return the laws of the best starts that have a fit of their own, best first."""
        unknowns = self.problem.unknowns
        own = [r for r in self.best.ranked[1:] if r.same_as is None]
        others = [np.array(r.unknowns) for r in own[: BEST - 1]]
        return [self.law, *(unknowns.law(self.law, y) for y in others)]


#: Logarithmic strains of `answers`, beside the end of the valid ones.
STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)
#: Share of the end beyond which a strain is left out.
NEAR = 0.95


@dataclass(frozen=True)
class Answer:
    """One modulus at one logarithmic strain, as it is reported.

    Attributes
    ----------
    modulus : str
    strain : float
    value : float
        MPa.
    per_width : float
        kN/m.
    reported : ReportedModulus or None
        At this one strain; None where the uncertainty is not known.
    end : bool
        Whether the modulus is fitted no further.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    reported: ReportedModulus | None
    end: bool

    @property
    def sigma(self) -> float | None:
        """Return one standard deviation over the modulus; None if not known."""
        return None if self.reported is None else float(self.reported.sigma[0])

    @property
    def band(self) -> tuple[float, float] | None:
        """Return the ends of the 95 % band, MPa; None if not known."""
        known = self.reported
        return None if known is None else (float(known.lower[0]), float(known.upper[0]))

    @property
    def bounds(self) -> tuple[bool, bool]:
        """Return whether a bound of the fit makes the lower and the upper end of the band."""
        known = self.reported
        if known is None:
            return False, False
        return bool(known.at_lower_bound[0]), bool(known.at_upper_bound[0])

    @property
    def on_bound(self) -> str:
        """Return the bound that the value itself lies on ("lower", "upper"), "" for none."""
        if self.reported is None:
            return ""
        if self.reported.on_lower_bound[0]:
            return "lower"
        return "upper" if self.reported.on_upper_bound[0] else ""

    @property
    def determined(self) -> bool:
        """Return whether the data determine the modulus."""
        return self.reported is not None and bool(self.reported.determined[0])

    @property
    def marks(self) -> tuple[str, str, str]:
        """Return the mark of a bound at value, lower and upper end, "" where there is none."""
        at = (bool(self.on_bound), *self.bounds)
        value, lower, upper = (BOUND_MARK * flag for flag in at)
        return value, lower, upper

    @property
    def value_words(self) -> str:
        """Return the modulus in MPa, marked where it lies on a bound."""
        return f"{self.value:.4g}{self.marks[0]}"

    @property
    def sigma_words(self) -> str:
        """Return one standard deviation in words."""
        if self.sigma is None:
            return "not known"
        return sigma_words(self.sigma, not self.determined)

    @property
    def band_words(self) -> str:
        """Return the ends of the band in MPa, marked where a bound of the fit makes them."""
        if self.band is None:
            return "not known"
        _, lower, upper = self.marks
        return f"{self.band[0]:.4g}{lower} to {self.band[1]:.4g}{upper}"

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the row as it is written to `result.json`."""
        lower, upper = self.bounds
        return {
            "strain": self.strain,
            "MPa": self.value,
            "kN_per_m": self.per_width,
            "sigma": self.sigma,
            "band": self.band,
            "at_lower_bound": lower,
            "at_upper_bound": upper,
            "on_bound": self.on_bound or None,
            "determined": self.determined,
        }


def answers(best: BestFit, thickness: float) -> list[Answer]:
    """Return E1, E2 and G12 at a few strains up to the end of the valid ones; thickness : mm."""
    found = []
    sure = best.certainty
    for name, component in COMPONENTS.items():
        end = float(best.valid[component])
        for strain in [*(strain for strain in STRAINS if strain < NEAR * end), end]:
            value = float(best.law.modulus(name, strain))
            known = None if sure is None else sure.at(best.law, name, np.array([strain]))
            found.append(Answer(name, strain, value, value * thickness, known, strain == end))
    return found


def answer_numbers(best: BestFit, thickness: float) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of `answers` by modulus."""
    numbers: dict[str, list[dict[str, Any]]] = {}
    for answer in answers(best, thickness):
        numbers.setdefault(answer.modulus, []).append(answer.numbers)
    return numbers


#: Columns before the correlations.
COLUMNS = ("unknown", "unit", "value", "sigma", "lower_bound", "upper_bound")
#: Name of all tests together among the tests.
TOGETHER = "all together"


def start_rows(fit: Fit) -> list[dict[str, Any]]:
    """Return a row a start in plain values."""
    coarse = () if fit.coarse_to_fine is None else COARSE
    return [
        {
            "start": r.number,
            "seed": list(r.seed),
            "objective": r.objective,
            "status": r.status,
            **{name: getattr(r, name) for name in COUNTED},
            **{name: getattr(r, name) for name in coarse},
        }
        for r in fit.best.records
    ]


def result_of(fit: Fit) -> dict[str, Any]:
    """Return the result in plain values; numbers of a single test also stand at the top."""
    project = fit.project
    best = fit.best
    law = fit.law
    records = best.records
    sure = best.certainty
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
        "starts": start_rows(fit),
        "coarse_to_fine": fit.coarse_to_fine,
        **{name: sum(getattr(r, name) for r in records) for name in COUNTED},
        "optima": fit.agreement,
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
            "noise": sure.noise.level,
            "values_that_err_as_one": sure.noise.correlated_count,
            "largest_relative_sigma": {n: float(s.max()) for n, s in sure.sigma.items()},
            "median_relative_sigma": {n: float(np.median(s)) for n, s in sure.sigma.items()},
            "largest_relative_noise": _largest(sure.noise_sigma),
            "largest_relative_mesh": _largest(sure.mesh),
            "mesh_error": CORRECTED if sure.taken_out else TOLD,
            "second_order": None if sure.order is None else sure.order.numbers,
            "smooth_beyond_noise": {
                name: discrepancy.numbers for name, discrepancy in sure.discrepancy.items()
            },
        }
    result["reported"] = answer_numbers(best, fit.thickness)
    result["verdict"] = fit.verdict.numbers
    if fit.verdicts:
        result["unknowns"] = {verdict.name: verdict.numbers for verdict in fit.verdicts}
    result["provenance"] = PROVENANCE
    result["tests"] = {name: f.numbers for name, f in fit.findings.items()}
    if len(fit.findings) == 1:
        result |= next(iter(fit.findings.values())).numbers
    else:
        norms = fit.problem.norms(fit.best.point.residual)
        errors = {}
        weights = {name: project.tests[name].weight for name in fit.tests}
        for name, fitted in fit.tests.items():
            own = np.concatenate([norms[c.name] for c in fitted.comparisons])
            errors[name] = float(own.sum() / weights[name])
        result |= {"mean_relative_error": errors, "weights": weights, "pinned": pinned_numbers(fit)}
    if fit.predicted:
        result["predicted"] = {
            name: {"rms": dict(one.rms), "units": dict(one.units), "relative_error": one.error}
            for name, one in fit.predicted.items()
        }
    warnings = [note.line for note in fit.notes]
    return result | {"warnings": warnings, "notes": note_records(fit.notes)}


def _largest(relative: Mapping[str, np.ndarray] | None) -> dict[str, float] | None:
    return None if relative is None else {n: float(np.abs(s).max()) for n, s in relative.items()}


def pinned_numbers(fit: Fit) -> dict[str, dict[str, dict[str, float]]]:
    """Return least, median and largest sigma of `Fit.pinned`, and the share not determined."""
    return {
        source: {name: modulus.numbers for name, modulus in moduli.items()}
        for source, moduli in fit.pinned.items()
    }


def notes_of_fit(fit: Fit, pins: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[Note]:
    """Return the notes for page, terminal and json; pins : of `pinned_numbers`."""
    best = fit.best
    several = len(fit.problem.comparisons) > 1
    notes = list(best.certainty.undetermined) if best.certainty is not None else []
    notes += notes_of_states(prepared.test for prepared in fit.setup.tests)
    notes += notes_of_verdicts(fit.verdicts)
    if cut := [record for record in best.records if record.failure]:
        said = f"{len(cut)} of {len(best.records)} starts ended because {fit.project.fit.solver} "
        said += f"failed ({cut[0].failure}): --resume tries them again"
        notes.append(Note(STARTS, said))
    first = best.ranked[0]
    if first.status == ANALYSES_USED_UP:
        said = f"the best start used up its {first.analyses} analyses while its steps still gained:"
        notes.append(Note(NOT_CONVERGED, f"{said} not converged, raise fit.max_analyses"))
    notes += [note for judgement in fit.judgements for note in judgement.notes]
    ends = np.asarray(fit.law.strain_range)
    # What the solver that counts does not look at, the one that leads may have.
    leading = (best.differentiated or best.point).histories
    every = zip(fit.problem.comparisons, best.point.histories, leading, strict=True)
    for comparison, history, beside in every:
        unstable = beside.unstable if history.unstable is None else history.unstable
        own = [
            *unstable_words(unstable),
            *notes_beyond(strains_of(history), ends, BEYOND_LAW, WIDER),
        ]
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
        if note.kind != BELOW_NOISE or note.of not in computed
    ]
    left += notes_of_misfits(fit.misfits)
    notes += left if several else [Note(note.kind, str(note)) for note in left]
    for name, findings in fit.findings.items():
        told = [as_note(note) for note in findings.warnings]
        notes += [note.about(name) for note in told] if len(fit.findings) > 1 else told
    notes += [note for one in fit.predicted.values() for note in one.notes]
    notes += [
        Note(
            ALONE,
            f"{source} alone does not determine {name} at any strain",
        )
        for source, moduli in pins.items()
        if source != TOGETHER
        for name, numbers in moduli.items()
        if numbers["not_determined"] == 1.0
    ]
    return notes
