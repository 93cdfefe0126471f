"""A fit that is killed at random moments and gone on with: a few of the benchmark's kills."""

import random
import time
from pathlib import Path

from .. import needs
from ..commands import _import_all
from ..scripts import script


def test_a_killed_fit_ends_as_if_nobody_had_killed_it(tmp_path: Path) -> None:
    needs.linux("processes and what they leave")
    kills = script("benchmarks/bench_kills.py")
    _import_all()
    # The second is timed: the first may have had kernels to compile.
    for folder in ("first", "whole"):
        first = kills.Trial(tmp_path / folder, "fit")
        begun = time.monotonic()
        assert kills.finish(first.start()) == 0, first.said.read_text()
        seconds = time.monotonic() - begun
    whole, told = kills.content(first.out), kills.Told()
    assert {"result.json", "history.csv", "moduli.csv"} <= whole.keys()
    count = kills.one_trial(
        tmp_path / "one", "fit", whole, 0.7 * seconds, 3, random.Random(3), told
    )
    assert count >= 1 and (told.trials, told.equal) == (1, 1), told
    assert told.other == [] and told.left == []
