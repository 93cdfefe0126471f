"""Read an input deck as CalculiX and Abaqus write it (.inp), and propose what is to be found in it.

A deck is a list of blocks: a line with a keyword and its options, and lines of data below. The
constants of its materials become variables of a template; `default` keeps the deck's own number
where a project drops a parameter.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...storage.reading import input_errors, missing_file_reason

#: Names of the constants of a keyword and its option TYPE, or model of a rubber, in their order.
NAMES: Mapping[str, str] = {
    "ELASTIC": "E nu",
    "ELASTIC ISO": "E nu",
    "ELASTIC ORTHO": "D1111 D1122 D2222 D1133 D2233 D3333 D1212 D1313 D2323",
    "ELASTIC ANISO": "D1111 D1122 D2222 D1133 D2233 D3333 D1112 D2212 D3312 D1212 "
    "D1113 D2213 D3313 D1213 D1313 D1123 D2223 D3323 D1223 D1323 D2323",
    "ELASTIC ENGINEERING CONSTANTS": "E_1 E_2 E_3 nu_12 nu_13 nu_23 G_12 G_13 G_23",
    "ELASTIC LAMINA": "E_1 E_2 nu_12 G_12 G_13 G_23",
    "HYPERELASTIC MOONEY-RIVLIN": "C10 C01",
    "HYPERELASTIC NEO HOOKE": "C10",
    "HYPERELASTIC YEOH": "C10 C20 C30",
    "HYPERELASTIC ARRUDA-BOYCE": "mu lambda_m",
    "HYPERELASTIC OGDEN 1": "mu1 alpha1",
    "HYPERELASTIC OGDEN 2": "mu1 alpha1 mu2 alpha2",
    "HYPERELASTIC OGDEN 3": "mu1 alpha1 mu2 alpha2 mu3 alpha3",
    "HYPERELASTIC POLYNOMIAL 1": "C10 C01",
    "HYPERELASTIC POLYNOMIAL 2": "C10 C01 C20 C11 C02",
    "HYPERELASTIC REDUCED POLYNOMIAL 1": "C10",
    "HYPERELASTIC REDUCED POLYNOMIAL 2": "C10 C20",
    "HYPERELASTIC REDUCED POLYNOMIAL 3": "C10 C20 C30",
}
#: Options of *DAMPING that are constants.
DAMPING = ("ALPHA", "BETA", "STRUCTURAL")
USER_MATERIAL = "USER MATERIAL"
#: Factor between a constant and its proposed bounds, and bounds of a Poisson's ratio.
MARGIN = 5.0
POISSON = (0.0, 0.49)
PROPOSED_OUTPUT = "*NODE FILE\nU, RF\n"


@dataclass(frozen=True)
class DeckBlock:
    """A keyword in capitals, its options, the number of its line, and its lines of data.

    A line is its number, from 0, and its values.
    """

    keyword: str
    options: Mapping[str, str]
    line: int
    rows: Sequence[tuple[int, list[str]]]


@dataclass(frozen=True)
class DeckConstant:
    """A constant of a deck: its name and value, its line, and its place between the commas."""

    name: str
    value: float
    line: int
    field: int

    @property
    def bounds(self) -> tuple[float, float]:
        """Return proposed bounds, in two digits."""
        if self.name.startswith("nu") and POISSON[0] <= self.value <= POISSON[1]:
            return POISSON
        ends = sorted((self.value / MARGIN, self.value * MARGIN))
        return float(f"{ends[0]:.2g}"), float(f"{ends[1]:.2g}")


class InputDeck:
    """An input deck.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    lines : list of str
        With those of included files that hold constants in their place.
    blocks : list of DeckBlock
        Those of the deck itself.
    all_blocks : list of DeckBlock
        Those of the deck and of the files that it includes.
    included : mapping of str
        The text of these files by name.

    Raises
    ------
    InputError
        A file is missing, or holds no keyword.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines = _lines_with_constants(path)
        self.blocks = list(_blocks(self.lines))
        if not self.blocks:
            raise InputError(path, "", "holds no line with a keyword such as *MATERIAL")
        self.included: dict[str, str] = {}
        self.all_blocks: list[DeckBlock] = []
        self._include(self.blocks)

    def _include(self, blocks: Sequence[DeckBlock]) -> None:
        """Add blocks, and those of the files that they include."""
        for block in blocks:
            self.all_blocks.append(block)
            name = block.options.get("INPUT", "")
            if block.keyword != "INCLUDE" or name in self.included:
                continue
            if Path(name).name != name:
                problem = f"includes {name}; put it beside the deck, and name it without a folder"
                raise InputError(self.path, f"line {block.line + 1}", problem)
            lines = _lines(self.path.parent / name)
            self.included[name] = "\n".join(lines) + "\n"
            self._include(list(_blocks(lines)))

    def named(self, keyword: str, option: str) -> list[str]:
        """Return the values of an option in the order of the blocks with a keyword."""
        blocks = [b for b in self.all_blocks if b.keyword == keyword and option in b.options]
        return list(dict.fromkeys(block.options[option] for block in blocks))

    def summary(self) -> list[str]:
        """Return lines that list materials, node sets, steps and outputs."""
        steps = [
            f"*{block.keyword}"
            for step, block in pairwise(self.all_blocks)
            if step.keyword == "STEP"
        ]
        outputs = []
        for block in self.all_blocks:
            if block.keyword.endswith(("FILE", "PRINT", "OUTPUT")):
                values = [value for _, row in block.rows for value in row if value]
                outputs.append(f"*{block.keyword} {' '.join(values)}".strip())
        listed = {
            "materials": self.named("MATERIAL", "NAME"),
            "node sets": self.sets,
            "steps": steps,
            "outputs": list(dict.fromkeys(outputs)),
        }
        return [f"{words}: {', '.join(values) or 'none'}" for words, values in listed.items()]

    @property
    def sets(self) -> list[str]:
        """Return the names of the node sets."""
        names = [*self.named("NSET", "NSET"), *self.named("NODE", "NSET")]
        return list(dict.fromkeys(names))

    def constants(self) -> list[DeckConstant]:
        """Return the constants that may become parameters: those of materials, not zero."""
        material = ""
        places = []
        for block in self.blocks:
            if block.keyword == "MATERIAL":
                material = block.options.get("NAME", "")
            places += [(material, *place) for place in _places(block) if _number(place[-1])]
        materials: dict[str, set[str]] = {}
        for material, name, *_ in places:
            materials.setdefault(name, set()).add(material)
        constants: dict[str, DeckConstant] = {}
        for material, name, line, field, text in places:
            suffix = f"_{material}" if len(materials[name]) > 1 else ""
            full_name = re.sub(r"\W", "_", name + suffix)
            while full_name in constants:
                full_name += "_"
            constants[full_name] = DeckConstant(full_name, _number(text), line, field)
        return list(constants.values())

    def template(self, constants: Sequence[DeckConstant]) -> str:
        """Return the deck as a template of constants, with output of displacements and forces."""
        lines = list(self.lines)
        for number, line in enumerate(lines, start=1):
            if "{{" in line or "{%" in line or "{#" in line:
                problem = "has marks of a template: name it in [[deck]] as it is"
                raise InputError(self.path, f"line {number}", problem)
        for constant in constants:
            fields = lines[constant.line].split(",")
            prefix = re.match(r".*=|\s*", fields[constant.field])
            variable = f"{{{{ {constant.name} | default({constant.value!r}) | number }}}}"
            fields[constant.field] = f"{prefix[0] if prefix else ''}{variable}"
            lines[constant.line] = ",".join(fields)
        text = "\n".join(lines) + "\n"
        if self.has_forces:
            return text
        return re.sub(r"^\*END STEP", f"{PROPOSED_OUTPUT}\\g<0>", text, flags=re.I | re.M)

    @property
    def has_forces(self) -> bool:
        """Return whether displacements and forces of nodes are written."""
        words = {
            value.upper()
            for block in self.all_blocks
            for _, row in block.rows
            for value in row
            if block.keyword in ("NODE FILE", "NODE OUTPUT")
        }
        return {"U", "RF"} <= words

    def loading(self) -> dict[str, Any]:
        """Return what loads the deck last: its place, its axis, and whether it is prescribed."""
        loading: dict[str, Any] = {}
        for block in self._blocks_of_steps():
            is_prescribed = block.keyword == "BOUNDARY"
            size = {"BOUNDARY": 4, "CLOAD": 3}.get(block.keyword, 0)
            for _, row in block.rows:
                if len(row) == size and row[1] in ("1", "2", "3") and _number(row[-1]):
                    place = {"place": self._place(row[0]), "axis": "xyz"[int(row[1]) - 1]}
                    loading = {**place, "is_prescribed": is_prescribed}
        return loading

    def _blocks_of_steps(self) -> list[DeckBlock]:
        """Return the blocks from the first step on."""
        keywords = [block.keyword for block in self.all_blocks]
        return self.all_blocks[keywords.index("STEP") :] if "STEP" in keywords else []

    def _place(self, name: str) -> str:
        """Return the key of a set, or of the place of a node."""
        for block in self.all_blocks if name.isdigit() else ():
            for _, row in block.rows if block.keyword == "NODE" else ():
                if row[0] == name:
                    return f"node = [{', '.join(str(_number(value)) for value in row[1:4])}]"
        return f'set = "{name}"'


def _lines_with_constants(path: Path) -> list[str]:
    """Return the lines of a deck; files with constants stand where the deck includes them."""
    lines = _lines(path)
    for block in reversed(list(_blocks(lines))):
        included = path.parent / Path(block.options.get("INPUT", "")).name
        if block.keyword == "INCLUDE" and included.is_file() and included != path:
            nested = _lines(included)
            if any(list(_places(part)) for part in list(_blocks(nested))):
                lines[block.line : block.line + 1] = nested
    return lines


def _lines(path: Path) -> list[str]:
    """Return the lines of a file; InputError."""
    if not path.is_file():
        raise InputError(path, "", missing_file_reason(path))
    with input_errors(path):
        return path.read_text(encoding="latin-1").splitlines()


def _blocks(lines: Sequence[str]) -> Iterator[DeckBlock]:
    """Yield the blocks of a deck."""
    rows: list[tuple[int, list[str]]] = []
    for number, line in enumerate(lines):
        if line.startswith("**") or not line.strip():
            continue
        values = [value.strip() for value in line.split(",")]
        if not line.lstrip().startswith("*"):
            rows.append((number, values))
            continue
        rows = []
        words = (value.partition("=") for value in values[1:])
        options = {name.strip().upper(): value.strip(' "') for name, _, value in words}
        keyword = " ".join(values[0].lstrip("* ").upper().split())
        yield DeckBlock(keyword, options, number, rows)


def _places(block: DeckBlock) -> Iterator[tuple[str, int, int, str]]:
    """Yield name, line, field and text of each constant of a block."""
    if block.keyword == "DAMPING":
        for field, (option, text) in enumerate(block.options.items(), start=1):
            if option in DAMPING:
                yield f"damping_{option.lower()}", block.line, field, text
        return
    names = _names(block)
    places = ((line, field, text) for line, row in block.rows for field, text in enumerate(row))
    filled = (place for place in places if place[-1])  # a line may end with a comma
    for name, (line, field, text) in zip(names, filled, strict=False):
        yield name, line, field, text


def _names(block: DeckBlock) -> list[str]:
    """Return the names of the constants of a material's block; none of another block."""
    if block.keyword == USER_MATERIAL:
        return [f"c{number + 1}" for number in range(int(block.options.get("CONSTANTS", 0)))]
    model = block.options.get("TYPE", "").upper().removesuffix("TROPIC")
    if block.keyword == "HYPERELASTIC":
        model = next(iter(block.options), "POLYNOMIAL")
        has_order = model in ("OGDEN", "POLYNOMIAL", "REDUCED POLYNOMIAL")
        model += f" {block.options.get('N', 1)}" if has_order else ""
    return NAMES.get(f"{block.keyword} {model}".strip(), "").split()


def _number(text: str) -> float:
    """Return the number of a field, 0 where it is none."""
    try:
        return float(text.upper().replace("D", "E"))
    except ValueError:
        return 0.0
