"""How long `import bubblefit` takes, beside meshio's own import, which is in it.

Prints the best of five, each in a process of its own.
"""

from __future__ import annotations

import subprocess
import sys

CODE = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
NAMES = ("numpy", "meshio", "bubblefit", "bubblefit.cli.main")


def seconds(name: str) -> float:
    """Best of five imports, s."""
    command = [sys.executable, "-c", CODE.format(name)]
    return min(
        float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        for _ in range(5)
    )


def main() -> None:
    """One line each."""
    for name in NAMES:
        print(f"import {name:20s} {1e3 * seconds(name):6.0f} ms")


if __name__ == "__main__":
    main()
