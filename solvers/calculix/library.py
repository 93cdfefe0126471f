"""The law in CalculiX: a material library, compiled from `law.c` on first use, and its constants.

The moduli are passed to it in a file, as CalculiX 2.20 has room for 21 constants only, and writes
beyond its memory if there are more.
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
from ...materials.exports.base import Export, ExportFormat, ExportRemarks, UnitsOptions, heading
from ...materials.law import HypoelasticLaw
from ...materials.modulus_tables import piece_constants
from ...storage.templates import render
from ...storage.writing import cache_folder

SUFFIX = ".law"
#: First line of the file, before the law's number.
TITLE = "bubblefit law"


def law_number(law: HypoelasticLaw) -> int:
    """Return the number by which a deck identifies the law's moduli.

    It is a digest of all their digits, below 1.1e12.
    """
    return int.from_bytes(hashlib.sha256(_numbers(law).encode()).digest()[:5], "big")


def law_text(law: HypoelasticLaw) -> str:
    """Return the text of the file with the law's moduli.

    It holds the title and the law's number, the numbers of pieces of the three moduli, and a line
    for each piece: its end, then its coefficients. A law of the load ratio has a last line of the
    gains by load ratios and the constants of crimp.
    """
    return f"{TITLE} {law_number(law)}\n{_numbers(law)}"


def law_files(law: HypoelasticLaw) -> dict[str, str]:
    """Return the file with the law's moduli, by its name, for the folder where ccx runs.

    The library reads every *.law there.
    """
    return {f"bubblefit-{law_number(law)}{SUFFIX}": law_text(law)}


def _numbers(law: HypoelasticLaw) -> str:
    """Return the constants of a law as the lines that the material library reads."""
    constants = piece_constants(law, coupled=True)
    counts = constants[:3]
    numbers = list(constants[3:])
    if law.of_load_ratio:  # gains of E1 and E2, then T1, T2 and S
        numbers += [*law.coupling[1:], *[0.0] * 3][:5]
    rows = [[f"{count:.0f}" for count in counts]]
    words = [repr(float(x)) for x in numbers]
    rows += [words[i : i + 5] for i in range(0, len(words), 5)]
    return "".join(" ".join(row) + "\n" for row in rows)


#: Name on `*MATERIAL`: CalculiX loads libBUBBLEFIT.so and calls HYPOELASTIC. Several materials in
#: one deck: MATERIAL + "@BODY", MATERIAL + "@SEAM".
MATERIAL = "@BUBBLEFIT_HYPOELASTIC"
LIBRARY_FILE = "libBUBBLEFIT.so"
#: `*DEPVAR`: log strain eps1, eps2, gamma12 and Cauchy stress sigma1, sigma2, tau12 (MPa), both
#: in the material frame.
STATE_VARIABLES = 6
#: Smallest through-thickness stiffness (MPa) in a deck, so that the analysis, and not the deck,
#: refuses a law without stiffness.
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

    Their number must not be a multiple of 8, after which CalculiX reads one more line, nor exceed
    21. The stiffness through the thickness is the larger of E1 and E2 at zero strain, and that of
    transverse shear is G12.

    Parameters
    ----------
    law : HypoelasticLaw
    angle : float
        Angle from the first in-plane axis to the warp, degrees.
    normal_axis : 1 or 3
        Axis through the thickness: 3 without `*ORIENTATION` or with a rectangular one; 1 with a
        cylindrical one, where at angle 0 the warp is axial and the fill runs around.
    whole_times : bool
        Whether strain and stress become the start of the law's next increment only at whole total
        times, so that the law's increments are the steps of the deck.
    whole_until : int
        Time up to which that is so, and after which every increment of CalculiX is one of the law.
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
    """Return the path of libBUBBLEFIT.so, which is compiled if it is not in the cache.

    SolverFailure if there is no compiler or it fails. OutputError if the cache cannot be written.
    """
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
    """Run a compiler; SolverFailure with the end of its output if it fails."""
    process = subprocess.run(command, capture_output=True, text=True, errors="replace")
    if process.returncode != 0:
        tail = "\n".join((process.stderr or process.stdout).splitlines()[-25:])
        problem = f"{command[0]} does not compile the material library {SOURCE.name}"
        raise SolverFailure(problem, "calculix", process.returncode, tail)


def calculix(card: MaterialCard, options: UnitsOptions) -> Export:
    """Export a card for CalculiX: *MATERIAL, the C source of its library, and the moduli."""
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
    remarks = ExportRemarks(carries=(carries,), loses=loses, confirm=(confirm,))
    text = render(
        "calculix/card.inp.j2",
        head=heading(card, "CalculiX material", remarks, "**", options.unit_system),
        material=MATERIAL,
        constants=constants(card.law),
        states=STATE_VARIABLES,
        library=LIBRARY_FILE,
        flags=" ".join(FLAGS),
    )
    source = SOURCE.read_text(encoding="utf-8")
    return Export({".inp": text, ".c": source, SUFFIX: law_text(card.law)}, remarks)


FORMAT = ExportFormat("calculix", calculix, load_ratios=True)
