"""A fit that is killed at random moments and gone on with: a few of the benchmark's kills."""

import importlib
import pkgutil
import random
import time

import bubblefit

from ..support import needs
from ..support.paths import load_script

#: What a killed command, a copy of this process, has imported.
PACKAGES = "cli experiments inference materials project readers reports runs solvers".split()


def test_killed_fit_resumes_to_the_same_end(tmp_path):
    needs.linux("processes and what they leave")
    kills = load_script("benchmarks/bench_kills.py")
    kills.COMMANDS["fit"] = (kills.BUBBLE.replace("{starts}", "2"), ("fit",))
    for module in pkgutil.walk_packages(bubblefit.__path__, "bubblefit."):
        if module.name.split(".")[1] in PACKAGES and not module.name.endswith("__main__"):
            importlib.import_module(module.name)
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
