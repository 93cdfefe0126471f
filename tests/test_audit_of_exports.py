"""Every export read back by the auditor's own parsers, and exports that are disturbed by hand."""

import re

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.export_formats import FORMATS

from .audit.exports import audit_export, audit_words
from .builders.laws import TABLE_4_2
from .support.commands import in_process
from .support.disturbed_folders import other_digit

#: Formats with options, as of the command and as of the auditor.
OPTIONS = {
    "ls-dyna-mat34": [
        {"measure": "nominal"},
        {"measure": "true", "form": "24"},
        {"compression": "none", "form": "14"},
        {"for": "radioss"},
        {"for": "openradioss"},
    ],
    "abaqus-fabric": [{"points": 31, "density": 1.2e-9}],
    "constants": [{"shear": 0.05}],
    "gsa": [{"prestress-warp": 2.5, "prestress-fill": 2, "kept-warp": 0.4, "kept-fill": 1}],
    "marc": [{"points": 61}],
}


CASES = [(name, {}) for name in FORMATS]


CASES += [(name, options) for name, several in OPTIONS.items() for options in several]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Return a function that exports the card of Table 4.2 into a folder of its own."""
    folder = tmp_path_factory.mktemp("exports")
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.13] * 3)
    card = folder / "card.toml"
    write_card(MaterialCard(law, 0.81, "Table 4.2"), card)

    def export(name, **options):
        words = [f"--{key}={value}" for key, value in options.items()]
        target = folder / "-".join([name, *(f"{k}-{v}" for k, v in options.items())])
        if not target.exists():
            target.mkdir()
            run = ("export", card, "--format", name, *words, "--json")
            (folder / f"{target.name}.json").write_text(in_process(*run, cwd=target).stdout)
        return target, card

    return export


def audit_of(exported, name, options):
    target, card = exported(name, **options)
    return audit_export(target, card, name, **{k.replace("-", "_"): v for k, v in options.items()})


@pytest.mark.parametrize(("name", "options"), CASES)
def test_export_holds_the_law_of_its_card(exported, name, options):
    audit = audit_of(exported, name, options)
    assert audit.findings == []
    assert audit.audited == audit.numbers > 5
    target, _ = exported(name, **options)
    assert audit_words((target.parent / f"{target.name}.json").read_text(), target) == []


DATA = re.compile(r"(?<![\w.(/-])-?\d+\.\d+(?:[eEdD][-+]\d+)?(?![\w.)])")


COMMENTS = ("$", "#", "!", "**")


def disturbed_export(target, name, folder, random):
    """Copy an export with another digit in one of its data lines; return the line."""
    folder.mkdir()
    for path in target.iterdir():
        (folder / path.name).write_text(path.read_text())
    suffixes = {"calculix": (".inp", ".law"), "abaqus-umat": (".inp",), "marc-hypela2": (".f",)}
    files = [p for p in sorted(folder.iterdir()) if p.suffix in suffixes.get(name, (p.suffix,))]
    file = files[random.integers(len(files))]
    lines = file.read_text().splitlines()
    kept = r"\s+k\(|\s+across" if file.suffix == ".f" else ""
    rows = [
        k
        for k, line in enumerate(lines)
        if DATA.search(line)
        and not line.startswith((*COMMENTS, "Table 4.2"))
        and re.match(kept, line)
    ]
    row = rows[random.integers(len(rows))]
    numbers = list(DATA.finditer(lines[row]))
    number = numbers[random.integers(len(numbers))]
    changed = number[0]
    while float(re.sub("[dD]", "e", changed)) == float(re.sub("[dD]", "e", number[0])):
        changed = other_digit(number[0], random)
    lines[row] = lines[row][: number.start()] + changed + lines[row][number.end() :]
    file.write_text("\n".join(lines) + "\n")
    return f"{file.name}: {lines[row]}"


@pytest.mark.parametrize("name", FORMATS)
def test_changed_digit_of_an_export_is_found(exported, name, tmp_path):
    random, missed = np.random.default_rng(11), []
    target, card = exported(name)
    for number in range(8):
        folder = tmp_path / str(number)
        line = disturbed_export(target, name, folder, random)
        if not audit_export(folder, card, name).findings:
            missed.append(line)
    # Zeros of no meaning, and digits below the tolerance of what is evaluated anew.
    assert len(missed) <= 1, missed


def replaced(target, folder, *changes):
    folder.mkdir()
    found = 0
    for path in target.iterdir():
        text = path.read_text()
        for old, new in changes:
            found += old in text
            text = text.replace(old, "\0", 1).replace(new, old, 1).replace("\0", new, 1)
        (folder / path.name).write_text(text)
    assert found, changes
    return folder


#: Faults of meaning: two texts that are exchanged in a format.
EXCHANGED = {
    "abaqus-fabric": ("*UNIAXIAL, COMPONENT=1", "*UNIAXIAL, COMPONENT=2"),
    "marc": ("table               e1", "table               e2"),
    "ls-dyna-mat34": ("       101       102       103", "       102       101       103"),
    "radioss-law158": ("/FUNCT/101", "/FUNCT/102"),
    "gsa": ("Warp modulus                      ", "Weft modulus                      "),
    "constants": ("A_warp_kN_per_m", "A_warp_fill_kN_per_m"),
    "csv": ("warp,0.0", "fill,0.0"),
}


@pytest.mark.parametrize("name", EXCHANGED)
def test_exchanged_yarns_of_an_export_are_found(exported, name, tmp_path):
    target, card = exported(name)
    assert audit_export(replaced(target, tmp_path / "x", EXCHANGED[name]), card, name).findings


def test_wrong_thickness_or_unit_in_a_heading_is_found(exported, tmp_path):
    target, card = exported("rfem")
    for k, change in enumerate([("thickness 0.81 mm", "thickness 0.8 mm"), ("N/mm^2", "kN/m")]):
        assert audit_export(replaced(target, tmp_path / str(k), change), card, "rfem").findings
