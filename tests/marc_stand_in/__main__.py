"""`python -m marc_stand_in -j NAME -v no -b no ...`, as run_marc; this folder's parent on the path.

See `run_marc` beside this file, and faults.py for how it is told to fail.
"""

from __future__ import annotations

import sys

from .command import WrongCommand, parse
from .job import run


def main() -> int:
    """One job; the return code."""
    try:
        command = parse(sys.argv[1:])
    except WrongCommand as error:
        print(f"run_marc: {error}", file=sys.stderr)
        return 2
    if not (command.folder / f"{command.job}.dat").exists():
        print(f"run_marc: {command.job}.dat: no such file", file=sys.stderr)
        return 1
    if command.background:
        print("run_marc: the stand-in has no background; give -b no", file=sys.stderr)
        return 2
    code, said = run(command)
    print(said, file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
