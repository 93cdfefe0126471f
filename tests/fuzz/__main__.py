"""`python -m tests.fuzz`: valid files changed a little, read by every reader, until one fails.

    python -m tests.fuzz --examples 100000
    python -m tests.fuzz --only t19 --only frd --minutes 5 --seed 7

Every fault is printed once a place in the code, and its file written to --out, from where it goes
into tests/corpus/ when it is mended. Exit code 1 where there was one.
"""

import sys
import time
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import click
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .judging import fault
from .mutations import CHANGES, mutated
from .targets import targets

#: Examples of one reader before the next has its turn.
SHARE = 200


class Over(Exception):
    """The time is."""


@click.command()
@click.option("--examples", type=int, default=2000, show_default=True, help="in all")
@click.option("--minutes", type=float, help="end after this long, with what was tried so far")
@click.option("--only", multiple=True, help="a reader; several  [all]")
@click.option("--seed", "number", type=int, default=0, show_default=True, help="of what is drawn")
@click.option("--out", type=Path, default=Path("out/fuzz"), show_default=True)
def main(examples, minutes, only, number, out) -> None:
    """Read hostile files and say which were not refused in one line."""
    end = time.monotonic() + 60 * minutes if minutes else float("inf")
    chosen = {name: one for name, one in targets().items() if not only or name in only}
    each = -(-examples // len(chosen))
    tried, faults = Counter(), set()

    def look(name, target, count, number) -> None:
        @seed(number)
        @settings(
            max_examples=count, deadline=None, database=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        @given(st.sampled_from(target.seeds), CHANGES)
        def read(content, changes) -> None:
            if time.monotonic() > end:
                raise Over
            tried[name] += 1
            path.write_bytes(hostile := mutated(content, changes))
            wrong = fault(target.read, path)
            key = f"{name}: {wrong.split(' at ')[-1]}"
            if wrong and key not in faults:
                out.mkdir(parents=True, exist_ok=True)
                kept = out / f"{name.replace(' ', '-')}-{len(faults)}{target.suffix}"
                kept.write_bytes(hostile)
                faults.add(key)
                click.echo(f"{name}: {wrong} ({kept})")

        with TemporaryDirectory(prefix="fuzz-") as folder, suppress(Over):
            path = Path(folder) / f"hostile{target.suffix}"
            read()

    warnings.simplefilter("ignore")
    # A share at a time, so that every reader has its turn within the time.
    for turn in range(-(-each // SHARE)):
        for place, (name, target) in enumerate(chosen.items()):
            count = min(SHARE, each - turn * SHARE)
            look(name, target, count, 10**6 * number + 100 * turn + place)
    for name, count in tried.items():
        click.echo(f"{count:8d} {name}")
    click.echo(f"{tried.total():8d} files in all, {len(faults)} faults")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
