"""Read and write the material card `material.toml`: a law, its thickness, source and certainty.

Format 2 names its form and settings; 3 has `[certainty]`, directions whose products add up to the
covariance of the free coefficients, `[certainty.band]`, the ends of the fit's band, and
`[certainty.laws]`, draws of the coefficients where the band is no normal one. A file without
`format` is of format 1: cubics, and tri-linear laws by their breaks.
"""

import functools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import tomli_w
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, ValidationError
from pydantic_core import PydanticCustomError

from ..arguments import checked_arguments
from ..errors import InputError, OutputError, check_one_of
from ..light_dataclasses import dataclass
from ..readers.sections import MODULUS_UNITS, ModulusUnit, Positive, Section, first_error
from ..storage.reading import read_toml
from ..storage.writing import write_text
from .admissibility import ClosedPath, check_positive, closed_path, is_positive
from .forms import base
from .forms.symmetry import Symmetry, symmetric
from .law import HypoelasticLaw, ThicknessChange, moduli_html
from .memory import FIELDS, Memory

#: Share of a normal distribution inside a band.
LEVEL = 0.95
#: Standard deviations to the ends of a band.
BAND = 1.96
#: Of the largest: a direction in which the moduli are so much surer is left out.
SMALLEST = 1e-6
#: Strains a modulus at which directions are weighed and laws looked at.
PLACES = 41
#: Draws for each law that is asked for, before it is given up.
TRIES = 200
#: Draws that a card keeps where a band is no normal one.
DRAWS_OF_CARD = 200
#: Of the width of a band: what an end may be off that of a normal distribution.
NORMAL_WITHIN = 0.25


@dataclass(frozen=True, eq=False)
class CardCertainty:
    """The uncertainty that a fit leaves in the coefficients of its law.

    Parameters
    ----------
    directions : (k, free) array, MPa
        One standard deviation along each principal direction of the coefficients' covariance, the
        least certain first.
    words : str
        Which sources of error are counted, and of which tests.
    bands : dict of (3, n) arrays
        By modulus the strains and the lower and upper ends (MPa) of the band that the fit reported;
        empty where the card has none.
    draws : (m, free) array, MPa, or None
        Coefficients of laws drawn by the fit, within its bounds, where the normal distribution of
        the directions does not have its bands; None where it has.
    """

    directions: base.Array
    words: str = ""
    bands: Mapping[str, base.Array] = field(default_factory=dict)
    draws: base.Array | None = None

    @property
    def covariance(self) -> base.Array:
        """Return (free, free) MPa^2 of the law's free coefficients."""
        return self.directions.T @ self.directions

    def sigma(self, law: HypoelasticLaw, name: str, strain: ArrayLike) -> base.Array:
        """Return the standard deviation (n,) in MPa of a modulus ("E1", "E2", "G12") at strains."""
        rows = law.modulus_rows(name, strain)[:, list(law.form.free)]
        return np.sqrt(((rows @ self.directions.T) ** 2).sum(axis=1))

    def band(
        self, law: HypoelasticLaw, name: str, strain: ArrayLike
    ) -> tuple[base.Array, base.Array]:
        """Return (n,) MPa each, lower (>= 0) and upper end of 95 %: the fit's, else by `sigma`."""
        if name in self.bands:
            strains, *ends = self.bands[name]
            return band_at(strains, ends, strain, law.modulus(name, strain))
        modulus = law.modulus(name, strain)
        off = BAND * self.sigma(law, name, strain)
        return np.maximum(modulus - off, 0.0), modulus + off

    def shifted(self, law: HypoelasticLaw, along: ArrayLike) -> HypoelasticLaw:
        """Return the law off by so many standard deviations along each of the first directions."""
        steps = np.asarray(along, dtype=float)
        beta = law.beta.copy()
        beta[list(law.form.free)] += steps @ self.directions[: len(steps)]
        return law.with_beta(beta)

    def laws(
        self, law: HypoelasticLaw, count: int, random: "np.random.Generator"
    ) -> list[HypoelasticLaw]:
        """Return `count` random laws of positive moduli; ValueError if hardly any draw is one.

        They are those of `draws` where the card has them, and normal ones otherwise.
        """
        laws: list[HypoelasticLaw] = []
        if self.draws is not None:
            for coefficients in random.choice(self.draws, count, replace=count > len(self.draws)):
                beta = law.beta.copy()
                beta[list(law.form.free)] = coefficients
                laws.append(law.with_beta(beta))
            return laws
        for _ in range(TRIES * count):
            if len(laws) == count:
                break
            candidate = self.shifted(law, random.standard_normal(len(self.directions)))
            if is_positive(candidate):
                laws.append(candidate)
        if len(laws) < count:
            raise ValueError("hardly any law of this card's certainty has positive moduli")
        return laws


def band_at(
    strains: base.Array,
    ends: Sequence[base.Array],
    strain: ArrayLike,
    modulus: ArrayLike,
) -> tuple[base.Array, base.Array]:
    """Return the ends at strains (n,) of a band known at some; a modulus (n,) is always inside."""
    lower, upper = (np.interp(np.asarray(strain, dtype=float), strains, end) for end in ends)
    return np.minimum(lower, modulus), np.maximum(upper, modulus)


def certainty_of(
    law: HypoelasticLaw,
    coefficients: base.Array,
    words: str = "",
    bands: Mapping[str, base.Array] | None = None,
) -> CardCertainty:
    """Return the certainty of draws of the free coefficients (draws, free) MPa about the law's."""
    free = list(law.form.free)
    spread = (coefficients - law.beta[free]) / np.sqrt(len(coefficients))
    crimp = base.crimp_map(law.form)
    # Rows of the relative change of each modulus at each place, and of the constants of crimp, by
    # the free coefficients: directions are weighed by the change of moduli that they make.
    relative = [crimp[:, free] / (crimp @ law.beta)[:, None]]
    for name, strain in strains_of(law).items():
        for ratio in base.ratios_of(law.form, name):
            modulus = law.modulus(name, strain, ratio)[:, None]
            relative.append(law.modulus_rows(name, strain, ratio)[:, free] / modulus)
    # The rows of `upper` have the directions of the draws, and are as few as the coefficients.
    upper = np.linalg.qr(spread).R
    _, sizes, directions = np.linalg.svd(np.vstack(relative) @ upper.T, full_matrices=False)
    significant = directions[(sizes > SMALLEST * sizes[0]) & (sizes > 0)]
    normal = CardCertainty(significant @ upper, words)
    is_normal = all(
        _is_normal_band(normal, law, name, band) for name, band in (bands or {}).items()
    )
    rows = np.linspace(0, len(coefficients) - 1, DRAWS_OF_CARD).astype(int)
    draws = None if is_normal else coefficients[rows]
    return replace(normal, bands=bands or {}, draws=draws)


def _is_normal_band(
    normal: CardCertainty, law: HypoelasticLaw, name: str, band: base.Array
) -> bool:
    """Return whether a band (3, n) of a modulus is about that of a normal distribution."""
    strain, lower, upper = band
    reach = BAND * normal.sigma(law, name, strain)
    modulus = law.modulus(name, strain)
    difference = np.maximum(np.abs(modulus - reach - lower), np.abs(modulus + reach - upper))
    return bool((difference <= NORMAL_WITHIN * (upper - lower)).all())


def strains_of(law: HypoelasticLaw) -> dict[str, base.Array]:
    """Return strains (n,) by modulus, up to the end of the range; zero alone without one."""
    ends = {name: law.strain_range[c] for name, c in base.COMPONENTS.items()}
    return {
        name: np.linspace(0.0, end, PLACES) if end < base.UNLIMITED else np.zeros(1)
        for name, end in ends.items()
    }


def words_of(tests: Sequence[str], values: int, mesh: bool) -> str:
    """Say in words what a band is made of: its sources and the number of values of the tests."""
    named = ", ".join(tests)
    sources = "noise of the data and error of the mesh" if mesh else "noise of the data alone"
    return f"{sources}; {values} values of {named}; the form of the law is taken for right"


#: Numbers of the format: of a card that names its form, has its certainty, has its history.
FORMAT = 2
WITH_CERTAINTY = 3
WITH_HISTORY = 4
State = Literal["", "first loading", "conditioned"]
LAW = "hypoelastic orthotropic"
RANGE_NOTE = "Outside valid_strain a modulus keeps its end value."
#: What the key `law` of a tri-linear card of format 1 holds.
TRILINEAR_1 = "tri-linear"
#: Thicknesses that differ by less are the same.
SAME_THICKNESS = 1e-6


class ModulusBand(NamedTuple):
    """A modulus with its 95 % band, at one strain or at several.

    Attributes
    ----------
    strain : float or (n,) array
        Logarithmic strain.
    value, lower, upper : float or (n,) array, MPa
        The modulus, and the ends of its band; NaN where these are not known.
    """

    strain: Any
    value: Any
    lower: Any
    upper: Any

    def __str__(self) -> str:
        if np.ndim(self.strain):
            return repr(self)
        band = "band not known"
        if np.isfinite(self.upper):
            band = f"{LEVEL:.0%} band {self.lower:.4g} to {self.upper:.4g}"
        return f"{self.value:.4g} MPa at {100 * self.strain:.3g} % strain ({band})"


@dataclass(frozen=True, eq=False)
class MaterialCard:
    """A law with its thickness, name, source and certainty.

    Attributes
    ----------
    law : HypoelasticLaw
    thickness : float, mm
    certainty : CardCertainty or None
        None if it is not known.
    state : State
        Of the fabric that the law is of, "first loading" or "conditioned", "" if not known.
    parameters : mapping of str to float
        Values of parameters of decks, from the parameters.toml beside the card's file.

    Raises
    ------
    InputError
        A modulus is not positive in the range for which the card is to hold.
    """

    law: HypoelasticLaw
    thickness: float
    name: str = ""
    source: str = ""
    certainty: CardCertainty | None = None
    state: State = ""
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 < self.thickness < math.inf:
            raise InputError(None, "thickness", f"must be above zero, got {self.thickness:g} mm")
        if self.law.form.size:
            check_positive(self.law)

    @property
    def closed_path(self) -> ClosedPath:
        """Return the work of a closed path of strain to the ends of the range, which is none of a
        law that has an energy: hypoelastic ones have it only in part."""
        return closed_path(self.law)

    @checked_arguments
    def write(
        self, path: Path | str, unit: ModulusUnit = "GPa", *, overwrite: bool = False
    ) -> None:
        """Write the card to a file; raise OutputError if it exists, unless `overwrite`."""
        if Path(path).exists() and not overwrite:
            problem = "exists already; overwrite=True replaces it, or name another file"
            raise OutputError(f"{path}: {problem}")
        write_card(self, Path(path), unit)

    def modulus(self, name: str, strain: ArrayLike) -> ModulusBand:
        """Return a modulus with its 95 % band at one strain or several.

        Parameters
        ----------
        name : {"E1", "E2", "G12"}
        strain : float or (n,) array
            Logarithmic strain, 0.02 for 2 %.

        Returns
        -------
        ModulusBand
            Floats for one strain, otherwise (n,) arrays.

        Raises
        ------
        InputError
            No such modulus, or a strain for which the card is not valid.
        """
        check_one_of(name, base.COMPONENTS, "name")
        try:
            strains = np.asarray(strain, dtype=float)
        except (TypeError, ValueError):
            problem = f"expected numbers, got {repr(strain)[:60]}"
            raise InputError(None, "strain", problem) from None
        end = self.law.strain_range[base.COMPONENTS[name]]
        unknown = strains[(strains < 0.0) | ~(strains <= end)]
        if unknown.size:
            problem = f"expected strains from 0 to {end:.4g}, for which {name} is known"
            raise InputError(None, "strain", f"{problem}, got {unknown[0]:g}")
        value = self.law.modulus(name, strains)
        ends = (np.full_like(value, np.nan),) * 2
        if self.certainty is not None:
            ends = self.certainty.band(self.law, name, strains)
        return ModulusBand(*(array[()] for array in (strains, value, *ends)))

    @checked_arguments
    def export(
        self,
        name: str,
        folder: Path | str = ".",
        *,
        overwrite: bool = False,
        **options: Any,
    ) -> list[Path]:
        """Write the material for another program; InputError: unfit; OutputError: file there."""
        # Formats take cards, and one of them is a solver's own: they are found at run time.
        formats = import_module("bubblefit.solvers.export_formats").FORMATS
        if name not in formats:
            raise InputError(None, "name", f"expected one of {', '.join(formats)}, got {name!r}")
        return formats[name].write_files(
            self, Path(folder) / f"material-{name}", overwrite, **options
        )

    def __repr__(self) -> str:
        law = self.law
        certainty = self.certainty
        bands = "no bands" if certainty is None else f"bands of {certainty.words or 'a fit'}"
        return (
            f"MaterialCard {self.name!r}: {law.form.name} law, {self.thickness:g} mm, "
            f"nu12 {law.nu12:g}\n  {law.moduli_words()}\n  {bands}"
        )

    def _repr_html_(self) -> str:
        """Return the moduli with their bands as an HTML table, for notebooks."""
        words = f"{self.name or 'material card'}, {self.thickness:g} mm, nu12 {self.law.nu12:g}"
        certainty = self.certainty
        band = None if certainty is None else functools.partial(certainty.band, self.law)
        words = f"{words}; {self.closed_path.words}"
        return moduli_html(self.law, words, band, "" if certainty is None else f"{LEVEL:.0%} band")


def thickness_difference(card: MaterialCard, thickness: float) -> str | None:
    """Describe how `thickness` (mm) differs from that of the card; None where it does not."""
    share = thickness / card.thickness - 1
    if abs(share) < SAME_THICKNESS:
        return None
    comparative = "stiffer" if share > 0 else "softer"
    return (
        f"the card was fitted for a thickness of {card.thickness:g} mm, this is {thickness:g} mm: "
        f"with the card's moduli the fabric is {100 * abs(share):.3g} % {comparative}"
    )


def write_card(card: MaterialCard, path: Path, unit: ModulusUnit = "GPa") -> None:
    """Write a card with its moduli in `unit` ("GPa", "MPa" or "Pa")."""
    law = card.law
    settings_of_form = law.form.to_card()
    pieces = settings_of_form.pop("pieces", {})
    content = _content(card, unit) | settings_of_form
    content |= _content_of_history(card) | _content_of_certainty(card, unit)
    words = [
        "Tangent moduli of log strain; Cauchy stress.",
        law.form.describe(),
        RANGE_NOTE,
        card.closed_path.words,
    ]
    header = "".join(f"# {line}\n" for line in words)
    tables = _table_text("certainty.band", _bands_of_file(card, unit))
    tables += _table_text("certainty.laws", _laws_of_file(card, unit))
    tables += _table_text("pieces", pieces)
    write_text(path, header + tomli_w.dumps(content) + tables)


def _content(card: MaterialCard, unit: ModulusUnit) -> dict[str, Any]:
    """Return the keys that every card has."""
    law = card.law
    valid_strain = {}
    for name, end in zip(base.STRAIN_NAMES, law.strain_range, strict=True):
        if end < base.UNLIMITED:
            valid_strain[name] = [0.0, float(end)]
    return {
        "format": FORMAT,
        "name": card.name,
        "source": card.source,
        "law": LAW,
        "form": law.form.name,
        "unit": unit,
        "beta": [float(b) / MODULUS_UNITS[unit] for b in law.beta],
        "nu12": law.nu12,
        "thickness_mm": card.thickness,
        "thickness_change": law.thickness_change,
        "valid_strain": valid_strain,
    }


def _content_of_history(card: MaterialCard) -> dict[str, Any]:
    """Return state and memory of the fabric, with the format of cards that have them."""
    memory = card.law.memory
    if not card.state and memory is None:
        return {}
    content: dict[str, Any] = {"format": WITH_HISTORY, "state": card.state}
    if memory is not None:
        content["memory"] = {name: list(getattr(memory, name)) for name in FIELDS}
    return content


def _content_of_certainty(card: MaterialCard, unit: ModulusUnit) -> dict[str, Any]:
    """Return the certainty of the coefficients, with the format of cards that have it."""
    certainty = card.certainty
    if certainty is None:
        return {}
    directions = (certainty.directions / MODULUS_UNITS[unit]).tolist()
    content: dict[str, Any] = {"certainty": {"of": certainty.words, "directions": directions}}
    if not card.state and card.law.memory is None:
        content["format"] = WITH_CERTAINTY
    return content


def _laws_of_file(card: MaterialCard, unit: ModulusUnit) -> dict[str, list[list[float]]]:
    """Return the free coefficients of the laws that a fit drew, in seven digits."""
    if card.certainty is None or card.certainty.draws is None:
        return {}
    rows = (card.certainty.draws / MODULUS_UNITS[unit]).tolist()
    return {"beta": [[float(f"{value:.7g}") for value in row] for row in rows]}


def _bands_of_file(card: MaterialCard, unit: ModulusUnit) -> dict[str, list[list[float]]]:
    """Return strain, lower and upper end of the band of each modulus, in seven digits."""
    bands = {}
    for name, (strain, *ends) in (card.certainty.bands if card.certainty else {}).items():
        columns = [strain, *(end / MODULUS_UNITS[unit] for end in ends)]
        bands[name] = [[float(f"{value:.7g}") for value in column] for column in columns]
    return bands


def _table_text(name: str, table: Mapping[str, Any]) -> str:
    """Return a table of the card, if it holds anything: a line a key, not a line a number."""
    lines = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in table.items()]
    return "\n".join(["", f"[{name}]", *lines, ""]) if table else ""


def _from_zero(ends: list[float]) -> list[float]:
    """Return the two ends of a range of strain; raise a complaint unless it begins at zero."""
    if ends[0] != 0 or not ends[1] > 0:
        raise PydanticCustomError("range", "[0, end]")
    return ends


Ends = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_from_zero)]


class ValidStrain(Section):
    """[0, end] of each log strain; a direction left out has no end."""

    warp: Ends = Field(default=[0.0, base.UNLIMITED])
    fill: Ends = Field(default=[0.0, base.UNLIMITED])
    shear: Ends = Field(default=[0.0, base.UNLIMITED])


Band = Annotated[list[list[float]], Field(min_length=3, max_length=3)]


class BandFile(Section):
    """Strains, lower and upper ends of the 95 % band of each modulus, in `unit`."""

    E1: Band
    E2: Band
    G12: Band


class LawsFile(Section):
    """Free coefficients of laws drawn by a fit, in `unit`."""

    beta: list[list[float]]


class CertaintyFile(Section):
    """Steps of the free coefficients, one standard deviation each, and the band, in `unit`."""

    of: str = ""
    directions: list[list[float]]
    laws: LawsFile = Field(default_factory=lambda: LawsFile(beta=[]))
    band: BandFile | None = None


class MemoryFile(Section):
    """Permanent set, unloading, reloading and saturation of warp, fill and shear."""

    permanent_set: list[float]
    unloading: list[float]
    reloading: list[float]
    saturation: list[float]


class CardFile(Section):
    """The keys of a card that do not depend on its form."""

    format: Literal[1, 2, 3, 4] = 1
    name: str = ""
    source: str = ""
    law: str = ""
    form: str | None = None
    symmetry: Symmetry = "orthotropic"
    unit: ModulusUnit
    beta: list[float]
    nu12: float
    thickness_mm: Positive
    thickness_change: ThicknessChange = "constant"
    valid_strain: ValidStrain = Field(default_factory=ValidStrain)
    certainty: CertaintyFile | None = None
    state: State = ""
    memory: MemoryFile | None = None


@checked_arguments
def read_card(path: Path | str) -> MaterialCard:
    """Read a card of any format; raise InputError that names the file and the field."""
    path = Path(path)
    content = read_toml(path)
    try:
        return _card(content)
    except InputError as error:
        raise InputError(path, error.field, error.problem) from None


def read_parameters(path: Path) -> dict[str, float]:
    """Return the values of a file of parameters of decks by name; InputError if it is none."""
    values = {}
    for name, entry in read_toml(path).items():
        value = entry.get("value") if isinstance(entry, dict) else None
        if not isinstance(value, float | int):
            problem = "expected a parameter with its value, as in the parameters.toml of a fit"
            raise InputError(path, name, problem)
        values[name] = float(value)
    return values


def _card(content: Mapping[str, Any]) -> MaterialCard:
    """Return the card of a file's content; InputError, without the file's name, if it is wrong."""
    name, settings = _form(content)
    plain_keys = {key: value for key, value in content.items() if key not in settings}
    try:
        file = CardFile.model_validate(plain_keys)
    except ValidationError as error:
        raise first_error(None, error, CardFile) from None
    mpa = [b * MODULUS_UNITS[file.unit] for b in file.beta]
    if not all(map(math.isfinite, mpa)):
        largest = max(file.beta, key=abs)
        raise InputError(None, "beta", f"{largest:g} {file.unit} is too large a coefficient")
    # What the form says is of all strains, whatever part of them the card holds for.
    orthotropic = base.form_named(name, settings, [base.UNLIMITED] * 3)
    form = symmetric(orthotropic, file.symmetry, file.nu12)
    if len(mpa) != form.size:
        raise InputError(None, "beta", f"expected {form.size} coefficients, got {len(mpa)}")
    ends = np.array([end for _, (_, end) in file.valid_strain])
    law = HypoelasticLaw(
        np.array(mpa),
        nu12=file.nu12,
        strain_range=ends,
        thickness_change=file.thickness_change,
        form=form,
        memory=_memory(file),
    )
    return MaterialCard(
        law,
        file.thickness_mm,
        name=file.name,
        source=file.source,
        certainty=_certainty(file, law),
        state=file.state,
    )


def _memory(file: CardFile) -> Memory | None:
    """Return the memory; InputError where the card's format has neither memory nor state."""
    if file.format < WITH_HISTORY and (file.state or file.memory):
        problem = f"a card that has it is of format = {WITH_HISTORY}"
        raise InputError(None, "memory" if file.memory else "state", problem)
    return None if file.memory is None else Memory(**dict(file.memory))


def _certainty(file: CardFile, law: HypoelasticLaw) -> CardCertainty | None:
    """Return the certainty in a file, checked against the number of fitted coefficients.

    None if the file has no certainty. The directions are (k, free) in MPa.
    """
    if file.certainty is None:
        return None
    if file.format < WITH_CERTAINTY:
        raise InputError(None, "certainty", f"a card that has it is of format = {WITH_CERTAINTY}")
    free = len(law.form.free)
    directions = _rows_of(file, "directions", file.certainty.directions, free)
    draws = _rows_of(file, "laws.beta", file.certainty.laws.beta, free)
    return CardCertainty(
        directions,
        file.certainty.of,
        _bands(file),
        draws if draws.size else None,
    )


def _rows_of(file: CardFile, key: str, rows: list[list[float]], free: int) -> base.Array:
    """Return rows (k, free) in MPa of the key of a certainty; InputError where they are none."""
    for k, row in enumerate(rows):
        if len(row) != free:
            problem = f"expected {free} numbers, one a coefficient that is fitted, got {len(row)}"
            raise InputError(None, f"certainty.{key}[{k}]", problem)
    array = np.array(rows).reshape(-1, free) * MODULUS_UNITS[file.unit]
    if not np.isfinite(array).all():
        raise InputError(None, f"certainty.{key}", f"too large for {file.unit}")
    return array


def _bands(file: CardFile) -> dict[str, base.Array]:
    """Return strain and ends in MPa by modulus; InputError where they make no band."""
    assert file.certainty is not None
    if file.certainty.band is None:
        return {}
    bands = {}
    for name, rows in file.certainty.band:
        try:
            strain, lower, upper = np.array(rows)
            good = len(strain) > 0 and (np.diff(strain) >= 0).all() and (lower <= upper).all()
        except ValueError:
            good = False
        if not good:
            problem = "expected rising strains, lower and upper ends, as many of each"
            raise InputError(None, f"certainty.band.{name}", problem)
        bands[name] = np.array(
            [strain, lower * MODULUS_UNITS[file.unit], upper * MODULUS_UNITS[file.unit]]
        )
    return bands


def _form(content: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the name of the form and its settings; unknown keys are not looked at."""
    name = content.get("form")
    text = content.get("law", "")
    if content.get("format", 1) == 1:
        name = _form_of_format_1(name, text, "breaks" in content)
    elif name is None:
        raise InputError(None, "form", "this key is missing; add it")
    elif text not in ("", LAW):
        raise InputError(None, "law", f"expected {LAW!r}, got {text!r}")
    if not isinstance(name, str):
        raise InputError(None, "form", f"expected the name of a form, got {name!r}")
    setting_keys = base.form_settings(name)
    if not setting_keys and name not in base.form_names():
        base.form_named(name, {}, [base.UNLIMITED] * 3)  # says what there is
    return name, {key: content[key] for key in setting_keys if key in content}


def _form_of_format_1(name: Any, text: Any, has_breaks: bool) -> str:
    """Return the form of a card of format 1, which does not name it; `text` is what `law` says."""
    if name is not None:
        problem = f"this key is missing; a card that names its form is of format = {FORMAT}"
        raise InputError(None, "format", problem)
    if has_breaks:
        return "trilinear"
    if isinstance(text, str) and TRILINEAR_1 in text:
        raise InputError(None, "breaks", f"this key is missing; `law` says {TRILINEAR_1}")
    return "cubic"
