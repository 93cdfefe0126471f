"""The result of a fit: its law, material card, tables, notes and the content of result.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import NotNegative, checked_arguments
from ..errors import InputError, check_one_of
from ..experiments.base import Findings, FittedTest
from ..experiments.doubts import Judgement
from ..experiments.forward import (
    BEYOND_LAW,
    BEYOND_LAW_WORDS,
    by_strain,
    notes_beyond,
    strains_of,
    unstable_words,
)
from ..experiments.registry import presenter_of
from ..experiments.states import notes_of_states, state_of
from ..inference.assessment import (
    Certainty,
    covariance_from,
    moduli_from,
    residuals_by_quantity,
)
from ..inference.noise import (
    BELOW_NOISE,
    Misfit,
    NoiseTest,
    misfits,
    noise_tests,
    notes_of_misfits,
    notes_of_noise,
)
from ..inference.nuisance_fit import NuisanceVerdict, notes_of_verdicts, verdicts
from ..inference.posterior import Posterior
from ..inference.problem import ANALYSES_USED_UP, FitProblem
from ..inference.reported import LEVEL, ReportedModulus, moduli_sigmas
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard, ModulusBand
from ..materials.forms.base import COMPONENTS, Array, components_of
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, as_note, note_records
from ..processes import run_side_by_side
from ..project.project import Project
from ..storage.writing import plain_values
from ..version import __version__
from ..wording import html_table
from .certainty import CORRECTED, REPORTED, card_certainty
from .folder import PROVENANCE, Provenance, Reported, draw, versions, write_table
from .held_out import HeldOut, held_out, nuisance_of
from .setup import FitSetup, coarse_to_fine
from .simulation import Histories
from .starts import BestFit
from .verdict import (
    NOT_CONVERGED,
    FitVerdict,
    answer_numbers,
    answers,
    verdict_of,
    verdict_of_parameters,
)

STARTS = NoteKind("starts that failed", weight=2)
ALONE = NoteKind("undetermined alone", weight=1)
#: Number of best starts whose laws are drawn in one chart.
BEST_COUNT = 5
#: Last columns of the residuals.
COMPARED = ("quantity", "measured", "modelled", "difference", "unit")
#: Quantity of a bubble's residuals that `Fit.curves` returns.
HEIGHT = "dz"
#: Number of strains of each modulus in `Fit.moduli`, and its columns where nothing is known.
STRAIN_COUNT = 61
UNKNOWN_COLUMNS = {
    "lower_MPa": np.nan,
    "upper_MPa": np.nan,
    "sigma_relative": np.nan,
    "noise_relative": np.nan,
    "mesh_relative": np.nan,
    "at_lower_bound": False,
    "at_upper_bound": False,
    "determined": False,
}
#: Numbers of a start that are added up over all starts.
COUNTED = ("analyses", "external_runs", "cached_runs")
#: Name under which all tests together are listed beside the single tests.
TOGETHER = "all together"


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Reported):
    """The result of a fit: law, card, tables, numbers, notes, verdict and drawings.

    Attributes
    ----------
    setup : FitSetup
        Project, tests and their data, as they were fitted.
    problem : FitProblem
    best : BestFit
        The best fit of all starts, run once more from the unloaded state.
    wall_s : float
        Wall-clock time of the fit in seconds.
    record : Provenance
        Origin of the results.
    judgements : tuple of Judgement
        Doubts about the data.
    agreement : str
        Words on whether starts ended in one optimum.
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
    def has_law(self) -> bool:
        """Return whether a law is fitted, and not only parameters of decks."""
        return bool(self.law.form.size)

    @property
    def reached_law(self) -> HypoelasticLaw:
        """Return the law up to the strains that the tests reached, as its card has it."""
        return self.card.law if self.has_law else self.law

    @property
    def command(self) -> str:
        """Return the kind of the tests if they are all of one kind, or else "fit"."""
        kinds = {prepared.test.kind for prepared in self.setup.tests}
        return kinds.pop() if len(kinds) == 1 else "fit"

    @cached_property
    def card(self) -> MaterialCard:
        """Return the material card, valid for the strains that the tests reached.

        Raise InputError for a fit that has parameters of decks only.
        """
        if not self.has_law:
            problem = 'a fit with form = "none" has no material card, only parameters'
            raise InputError(self.project.path, "law.form", problem)
        has_several = len(self.findings) > 1
        quality = ", ".join(
            f"{name}: {findings.quality}" if has_several else findings.quality
            for name, findings in self.findings.items()
        )
        source = f"bubblefit {__version__} {self.command}, {self.project.path.name}, objective "
        source += f"{self.objective:.4g}, {quality}"
        if self.best.certainty is not None and self.best.certainty.taken_out:
            source += ", error of the mesh taken out"
        law = replace(self.law, strain_range=self.best.valid)
        certainty = card_certainty(self.problem, self.best, law, list(self.tests))
        state = state_of([prepared.test for prepared in self.setup.tests])
        return MaterialCard(law, self.thickness, self.project.title, source, certainty, state)

    @property
    def thickness(self) -> float:
        """Return the thickness without load (mm): the fabric's, or the fitted one."""
        names = [nuisance.name for nuisance in self.problem.unknowns.nuisance.shared]
        if "thickness" not in names:
            return self.project.fabric.thickness
        return float(self._reported[self.problem.unknowns.size + names.index("thickness")])

    @property
    def _reported(self) -> Array:
        """Return the unknowns (n,) that are reported, those of the law of the card."""
        return self.best.point.unknowns if self.posterior is None else self.posterior.best

    @cached_property
    def verdicts(self) -> tuple[NuisanceVerdict, ...]:
        """Return whether the data determine each unknown beside the moduli; empty if not known."""
        return () if self.posterior is None else verdicts(self.posterior, self.best.valid)

    @property
    def posterior(self) -> Posterior | None:
        """Return the posterior of the reported law; None if it is not known."""
        return None if self.best.certainty is None else self.best.certainty.reported

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Return value, standard deviation and 95 % band of each parameter of decks, by name.

        Empty where the uncertainty is not known.
        """
        return {v.name: {**v.numbers, "band": list(v.band)} for v in self.verdicts if v.drawn}

    @cached_property
    def tests(self) -> dict[str, FittedTest]:
        """Return the fitted tests by name, with their analyses by the best fit."""
        best = self.best
        names = [comparison.name for comparison in self.problem.comparisons]
        fitted = {}
        for prepared in self.setup.tests:
            comparisons = self.setup.comparisons_of(prepared)
            numbers = [names.index(comparison.name) for comparison in comparisons]
            nuisance: dict[str, float] = {}
            reported: dict[str, float] = {}
            values = self.problem.unknowns.nuisance_values
            for number in numbers:
                nuisance |= values(names[number], best.point.unknowns)
                reported |= values(names[number], self._reported)
            fitted[prepared.test.name] = FittedTest(
                comparisons=comparisons,
                histories=tuple(best.point.histories[number] for number in numbers),
                nuisance=nuisance,
                law=self.law,
                laws=self.laws,
                reached=best.reached,
                valid=best.valid,
                certainty=best.certainty,
                compared_with=names,
                without_mesh_error=reported,
            )
        return fitted

    @cached_property
    def findings(self) -> dict[str, Findings]:
        """Return, by test, numbers, quality and notes on the fit in the terms of its kind."""
        return {
            prepared.test.name: presenter_of(prepared.test.kind).findings(
                prepared, self.tests[prepared.test.name]
            )
            for prepared in self.setup.tests
        }

    @cached_property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json in plain values."""
        return plain_values(result_of(self))

    @cached_property
    def misfits(self) -> dict[str, Misfit]:
        """Return residual and noise of each comparison by name."""
        return misfits(self.problem, self.best.point.residual)

    @cached_property
    def noise_tests(self) -> dict[str, NoiseTest]:
        """Return statistical tests of residual against noise, where the noise is given."""
        return noise_tests(self.problem, self.best.point.residual)

    @cached_property
    def notes(self) -> list[Note]:
        """Return the notes that a reader must know before using the numbers."""
        return notes_of_fit(self)

    @cached_property
    def predicted(self) -> dict[str, HeldOut]:
        """Return the errors of the law, with its card's strains, at the tests of weight 0."""
        law = replace(self.law, strain_range=self.best.valid)
        parameters = nuisance_of(self.problem, self.best.point.unknowns)
        return {
            prepared.test.name: held_out(
                prepared,
                law,
                self.setup.make_solver,
                parameters=parameters,
                thickness=self.thickness,
            )
            for prepared in self.setup.predicted
        }

    @cached_property
    def verdict(self) -> FitVerdict:
        """Return the verdict: whether the moduli can be used, why not, and what to do next."""
        if not self.has_law:
            return verdict_of_parameters(self.verdicts, self.notes, self.misfits)
        unknowns = self.problem.unknowns
        bounds = zip(unknowns.form.modulus_of, *unknowns.box, strict=True)
        # A coefficient between equal bounds is not fitted.
        fitted = {name for name, lower, upper in bounds if upper > lower}
        return verdict_of(self.best, self.notes, self.misfits, fitted)

    @cached_property
    def pinned(self) -> dict[str, dict[str, ReportedModulus]]:
        """Return each modulus as every test alone would determine it, and as all tests do.

        Returns
        -------
        dict of dict of ReportedModulus
            By test, with "all together" last, and by modulus. Empty for a single test, and if the
            uncertainty is not known.
        """
        point = self.best.with_derivatives
        certainty = self.best.certainty
        if point is None or certainty is None or len(self.setup.tests) < 2 or not self.has_law:
            return {}
        leading = self.problem.differentiating
        names = [comparison.name for comparison in self.problem.comparisons]
        tests = [*self.tests.values()]

        def pinned_by(number: int) -> dict[str, ReportedModulus]:
            return moduli_from(
                leading,
                point,
                certainty.reported,
                self.law,
                certainty.strain,
                [names.index(comparison.name) for comparison in tests[number].comparisons],
                certainty.noise.residual_sigma,
            )

        pinned = zip(self.tests, run_side_by_side(pinned_by, len(tests)), strict=True)
        return {**dict(pinned), TOGETHER: certainty.moduli}

    @cached_property
    def sensitivity(self) -> dict[str, dict[str, Array]]:
        """Return how well each measured quantity alone determines each modulus.

        That is the reported 1 sigma, times the factor by which the best linear estimate from the
        quantity alone is less certain than that from all quantities.

        Returns
        -------
        dict of dict of (n,) arrays
            By quantity, with "all together" last, and by modulus the relative 1 sigma at the
            strains of its band, infinite where the fit does not determine the modulus. Empty if
            the uncertainty is not known.
        """
        point = self.best.with_derivatives
        certainty = self.best.certainty
        if point is None or certainty is None or not self.has_law:
            return {}
        problem = self.problem.differentiating
        rows_of = residuals_by_quantity(problem)
        rows_of[TOGETHER] = np.concatenate([*rows_of.values()])
        sigmas = {}
        for quantity, rows in rows_of.items():
            covariance = covariance_from(problem, point, rows, certainty.noise.residual_sigma)
            _, sigmas[quantity] = moduli_sigmas(
                problem.unknowns, self.law, self.best.valid, covariance
            )
        reported = {
            name: np.where(modulus.determined, modulus.sigma, np.inf) / sigmas[TOGETHER][name]
            for name, modulus in certainty.moduli.items()
        }
        return {
            quantity: {name: factor * of_quantity[name] for name, factor in reported.items()}
            for quantity, of_quantity in sigmas.items()
        }

    @cached_property
    def coarse_to_fine(self) -> dict[str, Any] | None:
        """Return which starts ran on which mesh; None if all ran on the full mesh."""
        return coarse_to_fine(self.setup, self.best.records)

    @property
    def stages(self) -> str:
        """Return `coarse_to_fine` as a line; empty unless starts ran so, or were to."""
        numbers = self.coarse_to_fine
        if numbers is None:
            is_set = self.project.fit.coarse_to_fine
            return "no test has a coarser mesh: every start ran on the full one" if is_set else ""
        meshes = ", ".join(
            f"{name} {quads['coarse']} of {quads['full']} quads"
            for name, quads in numbers["quads"].items()
        )
        return (
            f"{numbers['starts']} starts on the coarse mesh ({meshes}; "
            f"{numbers['coarse_analyses']} analyses); {numbers['distinct']} of them, one of each "
            f"distinct optimum, continued on the full one ({numbers['full_analyses']}), the others "
            "take its fit"
        )

    def moduli(self) -> pd.DataFrame:
        """Return E1, E2 and G12 along their strains, with band and standard deviation.

        Returns
        -------
        DataFrame
            61 rows per modulus, up to the largest strain that the tests reached:

            - modulus, strain : name, and logarithmic strain in the modulus' direction.
            - MPa : the modulus.
            - lower_MPa, upper_MPa : 95 % band, noise and mesh together.
            - sigma_relative : half the width of the 68 % band, divided by the modulus.
            - noise_relative : the part of it that the noise of the data makes.
            - mesh_relative : relative change of the modulus in the limit of fine meshes.
            - at_lower_bound, at_upper_bound : whether a bound of the fit ends the band there.
            - determined : whether the data determine the modulus.

            NaN and False where not known.
        """
        components = components_of(self.law.form)
        ends = {name: self.best.valid[component] for name, component in components.items()}
        return self._moduli_at(
            {name: np.linspace(0.0, end, STRAIN_COUNT) for name, end in ends.items()}
        )

    def _moduli_at(self, strains: Mapping[str, np.ndarray]) -> pd.DataFrame:
        """Return the table of `moduli` at other strains, by modulus."""
        if not strains:
            return pd.DataFrame(columns=["modulus", "strain", "MPa", *UNKNOWN_COLUMNS])
        tables = []
        for name, strain in strains.items():
            columns: dict[str, Any] = {
                "modulus": name,
                "strain": strain,
                "MPa": self.law.modulus(name, strain),
            }
            columns |= UNKNOWN_COLUMNS | self._uncertainty_columns(name, strain)
            tables.append(pd.DataFrame(columns))
        return pd.concat(tables, ignore_index=True)

    def _uncertainty_columns(self, name: str, strain: np.ndarray) -> dict[str, np.ndarray]:
        """Return the columns of `moduli` that are known of the uncertainty of a modulus."""
        certainty = self.best.certainty
        if certainty is None:
            return {}
        modulus = certainty.at(self.law, name, strain)
        noise = np.interp(strain, certainty.strain[name], certainty.noise_sigma[name])
        columns = {
            "lower_MPa": modulus.lower,
            "upper_MPa": modulus.upper,
            "sigma_relative": modulus.sigma,
            "noise_relative": noise,
            "at_lower_bound": modulus.at_lower_bound,
            "at_upper_bound": modulus.at_upper_bound,
            "determined": modulus.determined,
        }
        if certainty.mesh is not None:
            columns["mesh_relative"] = np.interp(
                strain, certainty.strain[name], certainty.mesh[name]
            )
        return columns

    def modulus(self, name: str, strain: ArrayLike) -> ModulusBand:
        """Return a modulus with its 95 % band at one strain or several, as `MaterialCard.modulus`.

        Raises
        ------
        InputError
            No such modulus, or a strain that the tests did not reach.
        """
        return self.card.modulus(name, strain)

    def bands(self, strains: ArrayLike | None = None) -> pd.DataFrame:
        """Return the 95 % band of each modulus.

        Parameters
        ----------
        strains : (n,) array, optional
            Logarithmic strains; by default those of `moduli`.

        Returns
        -------
        DataFrame
            modulus, strain, lower_MPa, upper_MPa; NaN at strains that the tests did not reach.
        """
        columns = ["modulus", "strain", "lower_MPa", "upper_MPa"]
        if strains is None:
            return self.moduli()[columns]
        all_strains = np.atleast_1d(np.asarray(strains, dtype=float))
        table = self._moduli_at(dict.fromkeys(COMPONENTS, all_strains))[columns]
        reached = table["modulus"].map(lambda name: self.best.valid[COMPONENTS[name]])
        is_known = (table["strain"] >= 0.0) & (table["strain"] <= reached)
        table.loc[~is_known, columns[2:]] = np.nan
        return table

    @checked_arguments
    def draw_laws(self, count: NotNegative = 100, *, seed: NotNegative = 0) -> list[HypoelasticLaw]:
        """Return random laws that agree with the data: 95 % of them lie within the band.

        Parameters
        ----------
        count : int
            Number of laws.
        seed : int
            The same seed draws the same laws.

        Returns
        -------
        list of HypoelasticLaw

        Raises
        ------
        InputError
            The fit has no uncertainty to draw from.
        """
        certainty = self.best.certainty
        if certainty is None:
            problem = "the solver gives no derivatives, so that nothing is known to draw from"
            raise InputError(self.project.path, "draw_laws", problem)
        posterior = certainty.corrected or certainty.posterior
        return posterior.laws(self.law, count, np.random.default_rng(seed))

    def history(self) -> Histories:
        """Return the analyses of the best fit, on the mesh of the fit.

        Returns
        -------
        Histories
            By name of the comparison: a bubble, a strip's direction. Displacements in mm, loads in
            N or MPa.
        """
        unknowns = self.problem.unknowns
        y = self.best.point.unknowns
        law = unknowns.law(self.problem.law, y)
        histories = {}
        for comparison, history in zip(
            self.problem.comparisons, self.best.point.histories, strict=True
        ):
            model = comparison.model_at(unknowns.nuisance_values(comparison.name, y))
            histories[comparison.name] = replace(history, model=model, law=law)
        return Histories(histories)

    def plot_moduli(self) -> Any:
        """Return a drawing of the moduli with their bands, as on the page.

        Returns
        -------
        Drawing
            A notebook shows it; `save("moduli.png")` (.svg, .pdf) writes it, and `spec` is Vega's
            specification. The charts are Vega's: into axes of matplotlib draw the columns of
            `moduli`.
        """
        return draw(self, "moduli")

    def plot_starts(self) -> Any:
        """Return a drawing of the optima of all starts, as `plot_moduli`."""
        return draw(self, "optima")

    def plot_residuals(self, test: str | None = None) -> Any:
        """Return a drawing of modelled less measured values of a test, or of all.

        Parameters
        ----------
        test : str, optional
            Name of a test; by default all.
        """
        return draw(self, "residuals", test)

    def plot_loads(self, test: str | None = None) -> Any:
        """Return a drawing of measured and modelled load curves.

        Parameters
        ----------
        test : str, optional
            Name of a test; by default the first that has any.
        """
        return draw(self, "of_kind", "loads", test)

    def plot_heights(self, test: str | None = None) -> Any:
        """Return a drawing of cuts through a bubble, measured and modelled.

        Parameters
        ----------
        test : str, optional
            Name of a test; by default the first that has any.
        """
        return draw(self, "of_kind", "heights", test)

    def plot_history(self, name: str | None = None, **look: Any) -> Any:
        """Return a drawing of one analysis of `history`.

        Parameters
        ----------
        name : str, optional
            Of the comparison; by default the first.
        **look
            As in `Histories.plot`.
        """
        return self.history().plot(name, **look)

    def __repr__(self) -> str:
        words = [
            f"{answer.modulus} {answer.value:.4g} MPa ({answer.band_words})"
            for answer in answers(self.best, self.thickness)
            if answer.strain == 0.0
        ]
        return (
            f"Fit of {', '.join(self.tests)}: objective {self.objective:.4g}, best of "
            f"{len(self.best.ranked)} starts, {len(self.notes)} notes\n"
            f"  without strain {', '.join(words)}; {LEVEL:.0%} band in brackets\n"
            f"  {self.verdict.lines[0]}"
        )

    def _repr_html_(self) -> str:
        """Return the fitted moduli with their bands as an HTML table, for notebooks."""
        rows = [
            [
                answer.modulus,
                f"{100 * answer.strain:.3g} %",
                f"{answer.value:.4g}",
                answer.band_words,
                f"{answer.per_width:.4g}",
            ]
            for answer in answers(self.best, self.thickness)
        ]
        words = f"{self.project.title}: {', '.join(self.tests)}, objective {self.objective:.4g}, "
        words += f"best of {len(self.best.ranked)} starts, {len(self.notes)} notes"
        return html_table(words, ["", "strain", "MPa", f"{LEVEL:.0%} band", "kN/m"], rows)

    def coefficients(self) -> pd.DataFrame:
        """Return the unknowns of the fit, with standard deviations and correlations.

        Returns
        -------
        DataFrame
            One row per unknown: first the coefficients of the law, in the project's unit, then the
            nuisance unknowns:

            - unknown, unit : name, and unit of the numbers.
            - value, sigma : value, and its standard deviation from noise, without bounds.
            - lower_bound, upper_bound : of the fit.
            - one column for each unknown, under its name : correlation with that unknown.

            NaN where not known.
        """
        unknowns = self.problem.unknowns
        scales = self.project.scales
        size = unknowns.size
        nuisance = unknowns.nuisance.all
        names = [*unknowns.labels, *unknowns.nuisance.names]
        scale = np.array([scales.modulus] * size + [1.0] * len(nuisance))
        sigma = np.full(len(names), np.nan)
        correlations = np.full((len(names), len(names)), np.nan)
        if self.posterior is not None:
            sigma = np.sqrt(np.diag(self.posterior.coefficient_covariance)) / scale
            correlations = self.posterior.correlations
        values = np.concatenate([self.law.beta[list(unknowns.free)], self._reported[size:]]) / scale
        lower, upper = unknowns.box
        nuisance_lower, nuisance_upper = unknowns.nuisance.bounds
        units = [scales.modulus_unit] * size + [n.unit for n in nuisance]
        table = pd.DataFrame(
            {
                "unknown": names,
                "unit": units,
                "value": values,
                "sigma": sigma,
                "lower_bound": np.concatenate([lower, nuisance_lower]) / scale,
                "upper_bound": np.concatenate([upper, nuisance_upper]) / scale,
            }
        )
        return pd.concat([table, pd.DataFrame(correlations, columns=names)], axis=1)

    def residuals(self) -> pd.DataFrame:
        """Return every value that was fitted, as modelled and as measured.

        Returns
        -------
        DataFrame
            One row per fitted value:

            - test, and what its kind says of part, frame and place (mm).
            - quantity, measured, modelled, difference, unit : modelled less measured.
        """
        tables = []
        for prepared in self.setup.tests:
            name = prepared.test.name
            table = presenter_of(prepared.test.kind).residuals(prepared, self.tests[name])
            table.insert(0, "test", name)
            tables.append(table)
        table = pd.concat(tables, ignore_index=True)
        places = [name for name in table if name not in COMPARED]
        return table[[*places, *COMPARED]]

    def curves(self) -> dict[str, pd.DataFrame]:
        """Return measured and modelled values as curves to draw.

        Returns
        -------
        dict of DataFrame
            By test, part and quantity, as "strips warp load" or "bubble dz". Columns as in
            `residuals`: what the values are drawn over (elongation_mm, pressure_kPa, ...), measured
            and modelled. Of a bubble it is dz at the point nearest to the centre.
        """
        curves = {}
        groups = self.residuals().groupby(["test", "part", "quantity"], sort=False)
        for key, rows in groups:
            labels = [str(label) for label in key]
            table = rows.dropna(axis="columns", how="all")
            if {"x_mm", "y_mm", "frame"} <= {
                *table
            }:  # of a surface, which is no curve but at one point
                if labels[-1] != HEIGHT:
                    continue
                distance = table["x_mm"] ** 2 + table["y_mm"] ** 2
                nearest = distance.groupby(table["frame"]).idxmin()
                table = table.loc[nearest].drop(columns=["frame", "x_mm", "y_mm"])
            table = table.drop(columns=["test", "part", "quantity", "difference", "unit"])
            curves[" ".join(dict.fromkeys(labels))] = table.reset_index(drop=True)
        return curves

    @checked_arguments
    def write_table(self, path: Path | str, table: str = "residuals") -> Path:
        """Write a table of the fit.

        Parameters
        ----------
        path : path
            Ends in .csv or .parquet.
        table : {"residuals", "moduli", "coefficients", "starts"}

        Raises
        ------
        InputError
            Another table or ending, or Parquet without pyarrow.
        OutputError
        """
        tables = {
            "residuals": self.residuals,
            "moduli": self.moduli,
            "coefficients": self.coefficients,
            "starts": self.starts,
        }
        check_one_of(table, tables, "table")
        return write_table(tables[table](), path)

    def starts(self) -> pd.DataFrame:
        """Return how each start ended.

        Returns
        -------
        DataFrame
            One row per start: start, objective, status, analyses, external_runs and cached_runs (of
            another program), seconds; if starts ran coarse to fine coarse_objective,
            coarse_analyses and same_as, the start whose fit it took.
        """
        # A start without a fit has no objective: NaN.
        table = pd.DataFrame(start_rows(self)).astype({"objective": float})
        seconds = [record.wall_s for record in self.best.records]
        table.insert(list(table.columns).index("cached_runs") + 1, "seconds", seconds)
        return table.drop(columns="seed")

    @property
    def laws(self) -> list[HypoelasticLaw]:
        """Return the laws of the best starts that have a fit of their own, best first."""
        unknowns = self.problem.unknowns
        fitted = [record for record in self.best.ranked[1:] if record.same_as is None]
        points = [np.array(record.unknowns) for record in fitted[: BEST_COUNT - 1]]
        return [self.law, *(unknowns.law(self.law, point) for point in points)]


# Numbers of result.json ---------------------------------------------------------------------------


def start_rows(fit: Fit) -> list[dict[str, Any]]:
    """Return one row of plain values for each start."""
    rows = []
    for record in fit.best.records:
        row = {
            "start": record.number,
            "seed": record.seed,
            "objective": record.objective,
            "status": record.status,
            "analyses": record.analyses,
            "external_runs": record.external_runs,
            "cached_runs": record.cached_runs,
        }
        if fit.coarse_to_fine is not None:
            row |= {
                "coarse_objective": record.coarse_objective,
                "coarse_analyses": record.coarse_analyses,
                "same_as": record.same_as,
            }
        rows.append(row)
    return rows


def result_of(fit: Fit) -> dict[str, Any]:
    """Return the content of result.json; numbers of a single test also stand at the top."""
    project = fit.project
    records = fit.best.records
    result = {
        "command": fit.command,
        "title": project.title,
        "solver": fit.problem.solver.name,
        "method": project.fit.method,
        "objective": fit.objective,
        "objective_is": fit.setup.objective_is,
        **law_numbers(fit),
        "seed": project.fit.seed,
        "starts": start_rows(fit),
        "coarse_to_fine": fit.coarse_to_fine,
        **{key: sum(getattr(record, key) for record in records) for key in COUNTED},
        "optima": fit.agreement,
        "warnings": [note.line for note in fit.notes],
        "notes": note_records(fit.notes),
        "wall_s": fit.wall_s,
        "versions": versions(),
        "misfit": {name: misfit_numbers(misfit) for name, misfit in fit.misfits.items()},
        "noise_given": {name: test.numbers for name, test in fit.noise_tests.items()},
    }
    if fit.best.certainty is not None:
        result["uncertainty"] = uncertainty_numbers(fit.best.certainty)
    result["reported"] = answer_numbers(fit.best, fit.thickness)
    result["verdict"] = fit.verdict.numbers
    if fit.verdicts:
        result["unknowns"] = {verdict.name: verdict.numbers for verdict in fit.verdicts}
    result["provenance"] = PROVENANCE
    result |= numbers_of_tests(fit)
    if fit.predicted:
        result["predicted"] = {
            name: {"rms": test.rms, "units": test.units, "relative_error": test.error}
            for name, test in fit.predicted.items()
        }
    return result


def law_numbers(fit: Fit) -> dict[str, Any]:
    """Return the law, and the strains for which it holds."""
    law = fit.law
    scales = fit.project.scales
    return {
        "moduli": law.form.name,
        "beta": {
            "unit": scales.modulus_unit,
            "labels": law.form.labels,
            "values": law.beta / scales.modulus,
        },
        **law.form.to_card(),
        "nu12": law.nu12,
        "strain_reached": by_strain(fit.best.reached),
        "valid_strain": by_strain(fit.best.valid),
    }


def misfit_numbers(misfit: Misfit) -> dict[str, Any]:
    """Return residual and noise of a comparison."""
    return {**asdict(misfit), "times_noise": misfit.ratio if misfit.noise > 0 else None}


def uncertainty_numbers(certainty: Certainty) -> dict[str, Any]:
    """Return what is known of the uncertainty of the moduli."""
    sigma = certainty.sigma
    order = certainty.order
    return {
        "noise": certainty.noise.level,
        "values_that_err_as_one": certainty.noise.correlated_count,
        "largest_relative_sigma": {name: s.max() for name, s in sigma.items()},
        "median_relative_sigma": {name: np.median(s) for name, s in sigma.items()},
        "largest_relative_noise": _largest(certainty.noise_sigma),
        "largest_relative_mesh": _largest(certainty.mesh),
        "mesh_error": CORRECTED if certainty.taken_out else REPORTED,
        "second_order": None if order is None else order.numbers,
        "smooth_beyond_noise": {
            name: discrepancy.numbers for name, discrepancy in certainty.discrepancy.items()
        },
    }


def _largest(relative: Mapping[str, np.ndarray] | None) -> dict[str, float] | None:
    """Return the largest absolute value of each array by name."""
    return None if relative is None else {n: np.abs(s).max() for n, s in relative.items()}


def numbers_of_tests(fit: Fit) -> dict[str, Any]:
    """Return the findings of the tests, and those of a single test without its name.

    Of several tests: their errors and weights, and what each of them determines.
    """
    tests = {name: findings.numbers for name, findings in fit.findings.items()}
    if len(tests) == 1:
        (numbers,) = tests.values()
        return {"tests": tests, **numbers}
    norms = fit.problem.norms(fit.best.point.residual)
    weights = {name: fit.project.tests[name].weight for name in fit.tests}
    errors = {}
    # The norm of a block is its relative RMS error times its share of the test's weight. The shares
    # add up to the weight, so that the sum over the weight is the mean of the errors.
    for name, fitted in fit.tests.items():
        norms_of_test = np.concatenate([norms[c.name] for c in fitted.comparisons])
        errors[name] = norms_of_test.sum() / weights[name]
    return {
        "tests": tests,
        "mean_relative_error": errors,
        "weights": weights,
        "pinned": {
            source: {name: modulus.numbers for name, modulus in moduli.items()}
            for source, moduli in fit.pinned.items()
        },
    }


# Notes --------------------------------------------------------------------------------------------


def notes_of_fit(fit: Fit) -> list[Note]:
    """Return the notes for page, terminal and result.json."""
    certainty = fit.best.certainty
    return [
        *(() if certainty is None else certainty.notes),
        *fit.best.notes,
        *notes_of_states(prepared.test for prepared in fit.setup.tests),
        *notes_of_verdicts(fit.verdicts),
        *notes_of_starts(fit),
        *(note for judgement in fit.judgements for note in judgement.notes),
        *notes_of_analyses(fit),
        *notes_of_residuals(fit),
        *notes_of_findings(fit),
        *(note for held_out in fit.predicted.values() for note in held_out.notes),
        *notes_of_pinned(fit),
    ]


def notes_of_starts(fit: Fit) -> list[Note]:
    """Return notes on starts that failed, and on a best one that has not converged."""
    notes = []
    records = fit.best.records
    failed = [record for record in records if record.failure]
    if failed:
        words = (
            f"{len(failed)} of {len(records)} starts ended because {fit.project.fit.solver} failed "
            f"({failed[0].failure}): --resume tries them again"
        )
        notes.append(Note(STARTS, words))
    first = fit.best.ranked[0]
    if first.status == ANALYSES_USED_UP:
        words = (
            f"the best start used up its {first.analyses} analyses while its steps still gained: "
            "not converged, raise fit.max_analyses"
        )
        notes.append(Note(NOT_CONVERGED, words))
    return notes


def notes_of_analyses(fit: Fit) -> list[Note]:
    """Return notes on instability, strains beyond the law, and remarks of the solver."""
    best = fit.best
    has_several = len(fit.problem.comparisons) > 1
    notes = []
    # What the solver that counts does not look at, the one that leads may have.
    leading_histories = (best.with_derivatives or best.point).histories
    for comparison, history, leading in zip(
        fit.problem.comparisons, best.point.histories, leading_histories, strict=True
    ):
        unstable = leading.unstable if history.unstable is None else history.unstable
        for note in (
            *unstable_words(unstable),
            *notes_beyond(strains_of(history), fit.law.strain_range, BEYOND_LAW, BEYOND_LAW_WORDS),
            *map(as_note, history.remarks),
        ):
            notes.append(note.about(comparison.name) if has_several else note)
    return notes


def notes_of_residuals(fit: Fit) -> list[Note]:
    """Return notes on residuals beside their noise.

    Computed data hold no noise: a residual below the noise assumed is as it should be.
    """
    computed = {
        comparison.name
        for prepared in fit.setup.tests
        if prepared.known is not None
        for comparison in fit.tests[prepared.test.name].comparisons
    }
    notes = [
        note
        for note in notes_of_noise(fit.noise_tests)
        if note.kind != BELOW_NOISE or note.of not in computed
    ]
    notes += notes_of_misfits(fit.misfits)
    if len(fit.problem.comparisons) > 1:
        return notes
    return [Note(note.kind, str(note)) for note in notes]


def notes_of_findings(fit: Fit) -> list[Note]:
    """Return notes of the tests in their terms."""
    has_several = len(fit.findings) > 1
    notes = []
    for name, findings in fit.findings.items():
        for note in map(as_note, findings.warnings):
            notes.append(note.about(name) if has_several else note)
    return notes


def notes_of_pinned(fit: Fit) -> list[Note]:
    """Return notes on moduli that a test alone determines nowhere."""
    return [
        Note(ALONE, f"{source} alone does not determine {name} at any strain")
        for source, moduli in fit.pinned.items()
        if source != TOGETHER
        for name, modulus in moduli.items()
        if modulus.numbers["not_determined"] == 1.0
    ]
