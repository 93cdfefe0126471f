"""A deck as a model: a template with parameters, filled for a law, with the files that it needs.

A mesh of a geometry file (.geo) of gmsh is made once. Conditions on the parameters are evaluated in
the sandbox of templates; those that are linear are inequalities of the optimiser as well.
"""

from __future__ import annotations

import ast
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...errors import InputError
from ...inference.nuisance import LinearCondition
from ...materials.card import MaterialCard
from ...materials.exports.base import ExportFormat
from ...materials.exports.curves import FABRIC, LAW58, MAT34
from ...materials.exports.subroutines import HYPELA2, NLELAST, UMAT
from ...materials.forms.base import Array
from ...materials.law import HypoelasticLaw
from ...solvers.calculix.library import MATERIAL, STATE_VARIABLES, constants
from ...solvers.decks import JOB, UserDeck, program_mark, render
from ...solvers.process import log_tail, run_process
from ...solvers.run_cache import digest_of
from ...solvers.scratch import run_folder, write_deck
from ...storage.reading import input_errors, read_bytes
from ...storage.templates import template_environment
from .results import DeckReader

#: Variables of a template that are no parameters of the deck.
RESERVED = ("beta", "E1", "E2", "G12", "nu12", "law", "thickness", "job")
TEMPLATE = ".j2"
#: Endings of the decks of programs that need one.
SUFFIXES = {"calculix": ".inp", "marc": ".dat"}
#: Blocks of the law for other programs, by their names in templates.
BLOCKS = {
    "umat": UMAT,
    "hypela2": HYPELA2,
    "nlelast": NLELAST,
    "mat34": MAT34,
    "law58": LAW58,
    "fabric": FABRIC,
}


@dataclass(frozen=True, eq=False)
class DeckModel:
    """A deck with values of its parameters.

    Attributes
    ----------
    folder : Path
        Folder of the template and of the files that it names.
    template : str
        Name of the template there.
    values : mapping of float
        Parameters by name, in their units.
    bounds : mapping of (float, float)
        Bounds of each parameter.
    feasible : str
        Condition on the parameters.
    thickness : float, mm
    reader : DeckReader
    listed : tuple of str
        Files that are copied although the deck does not name them.
    program : str
        Name of the solver: "calculix", "marc" or "command".
    command : tuple of str
        Words of the command, if it is one.
    timeout : float or None, s
    geometry : str
        File of gmsh from which the mesh is made, if any.
    """

    folder: Path
    template: str
    values: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    feasible: str
    thickness: float
    reader: DeckReader
    listed: tuple[str, ...] = ()
    program: str = "calculix"
    command: tuple[str, ...] = ()
    timeout: float | None = None
    geometry: str = ""

    def with_parameters(self, changes: Mapping[str, float]) -> Self:
        """Return the deck with changed parameters, or a changed "thickness" (mm).

        Raise InputError where its condition does not hold there.
        """
        values = {name: value + changes.get(name, 0.0) for name, value in self.values.items()}
        if not holds(self.feasible, values):
            words = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
            raise InputError(None, "feasible", f"{self.feasible} does not hold at {words}")
        thickness = self.thickness + changes.get("thickness", 0.0)
        return replace(self, values=values, thickness=thickness)

    @property
    def deck_name(self) -> str:
        """Return the name of the filled deck in the folder of a run."""
        own_suffix = Path(self.template.removesuffix(TEMPLATE)).suffix
        return JOB + SUFFIXES.get(self.program, own_suffix)

    @property
    def mark(self) -> str:
        """Return a digest of the template and of the files that it names."""
        with input_errors(self.folder / self.template):
            text = (self.folder / self.template).read_text(encoding="latin-1")
        return digest_of(text, self._named(text))

    def deck(self, law: HypoelasticLaw) -> UserDeck:
        """Return the filled deck with all files of a run; InputError names template and line."""
        moduli = {name: partial(_modulus, law, name) for name in ("E1", "E2", "G12")}
        subroutines: dict[str, str] = {}
        material = {"calculix": partial(calculix_material, law), "calculix_name": material_name}
        for name, export_format in BLOCKS.items():
            material[name] = partial(
                _block,
                subroutines,
                law,
                self.thickness,
                f"{name}.f",
                export_format,
            )
        context = {**self.values, **moduli, "law": material, "thickness": self.thickness}
        context |= {"beta": law.beta.tolist(), "nu12": law.nu12, "job": JOB}
        text = render("deck", self.template, context, self.folder)
        words = tuple(word.replace("{{ job }}", JOB) for word in self.command)
        program = shutil.which(words[0]) if words else None
        mark = program_mark(Path(program)) if program else ""
        files: dict[str, str | bytes] = {**self._named(text), **subroutines, self.deck_name: text}
        if self.geometry:
            with input_errors(self.folder / self.geometry):
                content = read_bytes(self.folder / self.geometry)
            files[Path(self.geometry).with_suffix(".inp").name] = _mesh_of(content)
        return UserDeck(files, self.reader, words, self.timeout, mark)

    def _named(self, text: str) -> dict[str, bytes]:
        """Return the files of the folder that a text, the command or such a file names."""
        files: dict[str, bytes] = {}
        texts = [" ".join([text, *self.command, *self.listed])]
        # Results of an earlier run must not pass for those of this one.
        paths = [
            path
            for path in self.folder.iterdir()
            if path.suffix != TEMPLATE
            and (path.name in self.listed or not fnmatch(path.name, self.reader.result))
        ]
        while texts:
            words = texts.pop()
            for path in paths:
                if path.name in words and path.name not in files and path.is_file():
                    with input_errors(path):
                        files[path.name] = read_bytes(path)
                    texts.append(files[path.name].decode("latin-1"))
        return files


def material_name(name: str = "") -> str:
    """Return the name of CalculiX' material, for the cards of its sections."""
    return f"{MATERIAL}@{name}" if name else MATERIAL


def calculix_material(
    law: HypoelasticLaw, name: str = "", angle: float = 0.0, **options: Any
) -> str:
    """Return *MATERIAL of CalculiX, by our library.

    Parameters
    ----------
    angle : float, degrees
        From axis 1 to the warp.
    options : object
        Further arguments of `constants`.
    """
    numbers = [f"{value:.13g}" for value in constants(law, angle, **options)]
    rows = "".join(", ".join(numbers[i : i + 8]) + "\n" for i in range(0, len(numbers), 8))
    head = f"*MATERIAL, NAME={material_name(name)}\n*USER MATERIAL, CONSTANTS={len(numbers)}\n"
    return f"{head}{rows}*DEPVAR\n{STATE_VARIABLES}\n"


def _block(
    subroutines: dict[str, str],
    law: HypoelasticLaw,
    thickness: float,
    source: str,
    export_format: ExportFormat,
    name: str = "FABRIC",
    **options: Any,
) -> str:
    """Return the law as a block of a deck; a subroutine that it needs is put beside the deck."""
    card = MaterialCard(law, thickness, name)
    texts = dict(export_format.export(card, **options).files)
    if ".f" in texts:
        subroutines[source] = texts.pop(".f")
    return "\n".join(texts.values())


def _modulus(law: HypoelasticLaw, name: str, strain: float) -> float:
    """Return a modulus, MPa, at a log strain."""
    return float(law.modulus(name, strain))


#: Meshes a geometry file in a process of its own, which it may end; groups become node sets.
GMSH_SCRIPT = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
gmsh.merge("mesh.geo")
gmsh.model.mesh.generate(gmsh.model.getDimension())
gmsh.write("mesh.inp")
"""


@lru_cache(maxsize=8)
def _mesh_of(geometry: bytes) -> bytes:
    """Return the mesh of a geometry as a CalculiX or Abaqus input file.

    Physical groups become element sets and node sets. Raise InputError where gmsh fails.
    """
    with run_folder("gmsh", None, False, "gmsh", "gmsh.log") as folder:
        write_deck(folder, {"mesh.geo": geometry})
        log = folder / "gmsh.log"
        timeout = 600.0  # s
        run_process([sys.executable, "-c", GMSH_SCRIPT], folder, log, timeout)
        mesh = folder / "mesh.inp"
        if not mesh.is_file():
            lines = [line for line in log_tail(log).splitlines() if line.startswith("Error")]
            problem = lines[0] if lines else "gmsh made no mesh of it"
            raise InputError(None, "geo", problem)
        return read_bytes(mesh)


def holds(condition: str, values: Mapping[str, float]) -> bool:
    """Return whether a condition such as "C10 + C01 > 0" holds; an empty one always does.

    It does not hold where it has no value, as 1 / 0. Raise InputError where it is no condition.
    """
    import jinja2

    environment = template_environment(jinja2.BaseLoader())
    try:
        compiled = environment.compile_expression(condition or "true", undefined_to_none=False)
        return bool(compiled(**values))
    except (jinja2.TemplateError, TypeError) as error:
        problem = f"{condition!r}: {error}; there are: {', '.join(values)}"
        raise InputError(None, "feasible", problem) from None
    except ArithmeticError:
        return False


def linear_conditions(
    condition: str, bounds: Mapping[str, tuple[float, float]]
) -> tuple[LinearCondition, ...]:
    """Return the linear ones of conditions that "and" joins, such as "C10 + C01 > 0".

    Parameters
    ----------
    condition : str
    bounds : mapping of (float, float)
        Bounds of each parameter.
    """
    try:
        tree = ast.parse(condition, mode="eval").body
    except SyntaxError:
        return ()
    parts = [tree]
    if isinstance(tree, ast.BoolOp) and isinstance(tree.op, ast.And):
        parts = tree.values
    widths = np.array([upper - lower for lower, upper in bounds.values()])
    conditions = []
    for part in parts:
        for difference in _differences(part, list(bounds)):
            *slopes, constant = difference.tolist()
            # By this share of the bounds' widths it is kept, so that ">" holds as well.
            margin = 1e-9 * float(np.abs(slopes) @ widths)
            if margin:
                conditions.append((dict(zip(bounds, slopes, strict=True)), margin - constant))
    return tuple(conditions)


def _differences(comparison: ast.expr, names: Sequence[str]) -> list[Array]:
    """Return larger minus smaller side of each pair that is compared, where both are linear.

    Each is an array (names + 1,), see `_linear`.
    """
    if not isinstance(comparison, ast.Compare):
        return []
    sides = [_linear(side, names) for side in (comparison.left, *comparison.comparators)]
    differences = []
    for operator, left, right in zip(comparison.ops, sides, sides[1:], strict=False):
        if left is None or right is None:
            continue
        if isinstance(operator, ast.Gt | ast.GtE):
            differences.append(left - right)
        elif isinstance(operator, ast.Lt | ast.LtE):
            differences.append(right - left)
    return differences


def _linear(node: ast.expr, names: Sequence[str]) -> Array | None:
    """Return slopes by each name, then the constant, (names + 1,); None if not linear."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return np.array([*np.zeros(len(names)), value])
        case ast.Name(id=name) if name in names:
            return np.array([*(float(name == other_name) for other_name in names), 0.0])
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            operand_slopes = _linear(operand, names)
            return None if operand_slopes is None else -operand_slopes
        case ast.BinOp(left=left, op=operator, right=right):
            return _joined(operator, _linear(left, names), _linear(right, names))
    return None


def _joined(operator: ast.operator, left: Array | None, right: Array | None) -> Array | None:
    """Return the slopes and the constant of two linear expressions that an operator joins.

    Parameters
    ----------
    left, right : (names + 1,) array
        Slopes and constant of each; None if it is not linear.
    """
    if left is None or right is None:
        return None
    match operator:
        case ast.Add():
            return left + right
        case ast.Sub():
            return left - right
        case ast.Mult() if not left[:-1].any():
            return left[-1] * right
        case ast.Mult() if not right[:-1].any():
            return left * right[-1]
        case ast.Div() if not right[:-1].any() and right[-1]:
            return left / right[-1]
    return None
