"""The law as a material library: `law.c`, compiled on first use and kept by content.

A file carries its moduli: CalculiX 2.20 has room for 21 constants, and writes on beyond them.
"""

import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Literal

from ...errors import OutputError, SolverFailure
from ...materials.card import MaterialCard
from ...materials.exports.base import Export, ExportFormat, NoOptions, Says, heading
from ...materials.law import HypoelasticLaw
from ...materials.modulus_tables import piece_constants
from ...storage.folders import cache_folder
from ...storage.templates import render

SUFFIX = ".law"
#: First line of the file, before the law's number.
TITLE = "bubblefit law"


def law_number(law: HypoelasticLaw) -> int:
    """Return what a deck calls the law's moduli: made of all their digits, below 1.1e12."""
    return int.from_bytes(hashlib.sha256(_numbers(law).encode()).digest()[:5], "big")


def law_text(law: HypoelasticLaw) -> str:
    """Return the file: title, number, counts of pieces; a line a piece: its end, coefficients; one
    of gains by load ratios and constants of crimp, if any."""
    return f"{TITLE} {law_number(law)}\n{_numbers(law)}"


def law_files(law: HypoelasticLaw) -> dict[str, str]:
    """Return the file by its name, to lie where ccx runs: the library reads every *.law there."""
    return {f"bubblefit-{law_number(law)}{SUFFIX}": law_text(law)}


def _numbers(law: HypoelasticLaw) -> str:
    constants = piece_constants(law, coupled=True)
    counts = constants[:3]
    numbers = list(constants[3:])
    if law.of_load_ratio:  # gains of E1 and E2, then T1, T2 and S
        numbers += [*law.coupling[1:], *[0.0] * 3][:5]
    rows = [[f"{count:.0f}" for count in counts]]
    rows += [[repr(float(x)) for x in numbers[i : i + 5]] for i in range(0, len(numbers), 5)]
    return "".join(" ".join(row) + "\n" for row in rows)


#: Name on `*MATERIAL`: CalculiX loads libBUBBLEFIT.so and calls HYPOELASTIC. Several materials in
#: one deck: MATERIAL + "@BODY", MATERIAL + "@SEAM".
MATERIAL = "@BUBBLEFIT_HYPOELASTIC"
LIBRARY_FILE = "libBUBBLEFIT.so"
#: `*DEPVAR`: log strain eps1, eps2, gamma12 and Cauchy stress sigma1, sigma2, tau12 (MPa), both
#: in the material frame.
STATE_VARIABLES = 6
#: A law without stiffness is for the analysis to refuse, not for the deck: MPa.
SMALLEST_MODULUS = 1e-3
SOURCE = Path(__file__).with_name("law.c")
# No contraction: the same rounding on every machine.
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-pthread")


def constants(
    law: HypoelasticLaw,
    angle: float = 0.0,
    normal_axis: Literal[1, 3] = 3,
    whole_times: bool = False,
    whole_until: int = 0,
) -> tuple[float, ...]:
    """Return the constants (9,) of `*USER MATERIAL`, in the order of `law.c`.

    No multiple of 8, of which CalculiX reads one more line, and never above 21. Through the
    thickness the larger of E1 and E2, and G12, at no strain. angle : degrees from the first
    in-plane axis to the warp. normal_axis : 3 without `*ORIENTATION` or with a rectangular one; 1
    with a cylindrical one: warp is axial and fill hoop at angle 0. whole_times : commit strain and
    stress only at whole total times, so that the law's increments are the deck's steps. whole_until
    : so up to this time, then at every increment.
    """
    normal_modulus = max(float(law.E1(0.0)), float(law.E2(0.0)), SMALLEST_MODULUS)
    transverse_shear = max(float(law.G12(0.0)), SMALLEST_MODULUS)
    cylinder_mark = -float(whole_until) if whole_until else float(whole_times)
    shape = (normal_modulus, transverse_shear, float(angle), float(normal_axis), cylinder_mark)
    moduli = (float(law_number(law)), sum(piece_constants(law, coupled=True)[:3]))
    return (law.nu12, law.area_power, *shape, *moduli)


def compiler() -> list[str]:
    """Return the C compiler as a command: $CC, else cc or gcc; SolverFailure: there is none."""
    named = shlex.split(os.environ.get("CC", ""))
    for command in [named] if named else [["cc"], ["gcc"]]:
        executable = shutil.which(command[0])
        if executable is not None:
            return [executable, *command[1:]]
    description = f"the C compiler {named[0]!r} that CC names" if named else "a C compiler (cc)"
    advice = "install gcc, or name a compiler in the environment variable CC"
    raise SolverFailure(
        f"the material library needs {description}, which is not there; {advice}", "calculix"
    )


def material_library(cache: Path | None = None) -> Path:
    """Return libBUBBLEFIT.so, compiled if need be; SolverFailure: no compiler; OutputError."""
    command = compiler()
    source = SOURCE.read_bytes()
    digest = hashlib.sha256(source)
    # The file's date and size stand for the compiler's version: asking for that takes a process.
    at = os.stat(command[0])
    for part in (*command, *FLAGS, str(at.st_size), str(at.st_mtime_ns), platform.machine()):
        digest.update(b"\0" + part.encode())
    folder = (cache_folder() if cache is None else cache) / "calculix"
    library = folder / f"law-{digest.hexdigest()[:16]}" / LIBRARY_FILE
    if library.is_file():
        return library
    try:
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".law-") as place:
            built = Path(place) / LIBRARY_FILE
            _compile([*command, *FLAGS, str(SOURCE), "-o", str(built), "-lm"])
            # Two processes at once: both have the same content, either may win.
            os.replace(built, library)
    except OSError as error:
        problem = f"cannot be written ({error.strerror}); name another folder: BUBBLEFIT_CACHE"
        raise OutputError(f"{folder}: {problem}") from None
    return library


def _compile(command: list[str]) -> None:
    process = subprocess.run(command, capture_output=True, text=True, errors="replace")
    if process.returncode != 0:
        tail = "\n".join((process.stderr or process.stdout).splitlines()[-25:])
        problem = f"{command[0]} does not compile the material library {SOURCE.name}"
        raise SolverFailure(problem, "calculix", process.returncode, tail)


def calculix(card: MaterialCard, options: NoOptions) -> Export:
    """Export *MATERIAL with *USER MATERIAL and *DEPVAR, the C source of its library, its moduli."""
    carries = (
        "the whole law: tangent moduli of log strain in any form, nu12, the range in which moduli "
        "hold, thickness constant or incompressible"
    )
    loses = (
        "the unsymmetric part of the tangent (CalculiX takes the symmetric one): more iterations, "
        "the same result",
        "through the thickness and in transverse shear the material is linear (constants 3 and 4)",
    )
    confirm = "that this ccx loads material libraries (Debian's does not): bubblefit doctor"
    says = Says(carries=(carries,), loses=loses, confirm=(confirm,))
    text = render(
        "calculix/card.inp.j2",
        head=heading(card, "CalculiX material", says, "**"),
        material=MATERIAL,
        constants=constants(card.law),
        states=STATE_VARIABLES,
        library=LIBRARY_FILE,
        flags=" ".join(FLAGS),
    )
    source = SOURCE.read_text(encoding="utf-8")
    return Export({".inp": text, ".c": source, SUFFIX: law_text(card.law)}, says)


FORMAT = ExportFormat("calculix", calculix, load_ratios=True)
