"""Lower bounds and licences of what bubblefit depends on, directly or not; part of `make lint`.

A licence is what the installed distribution's own metadata says. One that is not in the list below
fails, as does a dependency without a lower bound, and a file of somebody else's that is not named.
"""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Words of licences that ask for no more than their text and their authors' names.
ALLOWED = re.compile(
    r"MIT|BSD|Apache|Python Software Foundation|\bPSF|ISC\b|MPL|Mozilla Public|HPND|0BSD|Unlicense"
    r"|Zlib|CC0|CMU License|OFL",
    re.IGNORECASE,
)
#: Licences that ask for more, each with why it is none of bubblefit's own (MIT).
OTHERS = {
    "gmsh": "GPL-2.0-or-later with an exception; imported at run time, optional (generator = gmsh)",
    "quadprog": "GPL-2.0-or-later; imported at run time, not distributed with bubblefit",
    "yattag": "LGPL-2.1; of cosmic-ray, which only `make mutants` uses",
    "nlopt": "LGPL-2.1-or-later; a library that is linked at run time",
}
#: Licences that the metadata does not say, looked up in the distribution's own files.
UNSAID = {"meshioplusplus": "MIT"}
#: Files of the repository that somebody else has written, and their licence.
VENDORED: dict[str, str] = {}
#: Heads of files by others that would have to be in VENDORED.
FOREIGN = re.compile(r"Copyright \(c\)|SPDX-License-Identifier|@license", re.IGNORECASE)


def requirement(text: str) -> tuple[str, bool, bool]:
    """Name of a requirement, whether it has a lower bound, whether only an extra asks for it."""
    name = re.match(r"[\w.-]+", text.strip())
    assert name is not None, text
    plain, _, marker = text.partition(";")
    return (
        re.sub(r"[-_.]+", "-", name[0]).lower(),
        bool(re.search(r">=|==|~=|>", plain)),
        ("extra" in marker),
    )


def licence_of(found: Distribution) -> str:
    """What a distribution says of its licence; the first line where it is a whole text."""
    about = found.metadata
    classified = [c for c in about.get_all("Classifier") or [] if c.startswith("License ::")]
    said = [about.get("License-Expression"), *(c.split(" :: ")[-1] for c in classified)]
    own = (about.get("License") or "").strip().splitlines()
    return "; ".join(part for part in [*said, *own[:1]] if part and part != "UNKNOWN")


def problems(project: dict, root: Path) -> list[str]:
    """What is wrong, one line each."""
    direct = list(project["dependencies"])
    for needed in project["optional-dependencies"].values():
        direct += needed
    found = []
    waiting: list[str] = []
    for text in direct:
        name, bound, _ = requirement(text)
        waiting.append(name)
        if not bound:
            found.append(
                f"pyproject.toml: {text}: has no lower bound; add >= the oldest that works"
            )
    seen: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        try:
            one = distribution(name)
        except PackageNotFoundError:
            continue  # of another platform, or of an extra that is not installed here
        waiting += [n for n, _, extra in map(requirement, one.requires or []) if not extra]
        licence = UNSAID.get(name) or licence_of(one)
        if name not in OTHERS and not ALLOWED.search(licence):
            said = licence or "nothing"
            found.append(
                f"{name} {one.version}: licence {said!r} is none of those in .ci/licences.py"
            )
    found += [f"{path}: is somebody else's file; name it in VENDORED" for path in foreign(root)]
    print(f"licences: {len(seen)} distributions, {len(found)} problems")
    return found


def foreign(root: Path) -> list[Path]:
    """Files of the package with a head of somebody else's that are not named."""
    names = [p for s in ("*.js", "*.css", "*.c", "*.f", "*.j2") for p in root.glob(f"[!.]*/**/{s}")]
    ours = [path.relative_to(root) for path in names if "out" not in path.parts]
    return [
        path
        for path in ours
        if str(path) not in VENDORED
        and FOREIGN.search((root / path).read_text(encoding="utf-8", errors="replace")[:2000])
    ]


def main() -> None:
    """Exit 1 where something is wrong."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    wrong = problems(project, ROOT)
    print("\n".join(wrong), end="\n" if wrong else "")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
