"""`make calculix` where it does not have to build, and where it cannot."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from ...programs import program

SCRIPT = Path(__file__).resolve().parents[3] / ".ci" / "calculix"
# What any machine has; apt and dpkg are not among them.
COMMON = ("sh", "id", "sed", "head", "tail", "find", "mktemp", "dirname", "rm", "mkdir", "grep")


@pytest.fixture
def machine(tmp_path):
    """A PATH without apt, and an empty cache."""
    (tmp_path / "bin").mkdir()
    for name in COMMON:
        found = shutil.which(name)
        assert found
        (tmp_path / "bin" / name).symlink_to(found)
    program(tmp_path / "bin" / "cc", "#!/bin/sh\n")
    return tmp_path


def build(machine, code):
    variables = {k: v for k, v in os.environ.items() if k != "CC"}
    variables |= {"PATH": str(machine / "bin"), "BUBBLEFIT_CACHE": str(machine / "cache")}
    done = subprocess.run(
        ["/bin/sh", SCRIPT], env=variables, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == code, done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("ccx", "code", "words"),
    [
        ("#!/bin/sh\necho 'This is Version 2.99'\n", 0, "ccx is there already"),
        ("#!/bin/sh\nexit 127\n", 1, "does not run any more"),
        (None, 1, "apt-get is not there"),
        ("no compiler", 1, "as root: apt-get install gcc"),
    ],
)
def test_what_is_there_is_not_built_again_and_what_lacks_is_named(machine, ccx, code, words):
    if ccx == "no compiler":
        (machine / "bin" / "cc").unlink()
    elif ccx:
        program(machine / "cache" / "calculix" / "ccx-2.99-external" / "ccx", ccx)
    text = build(machine, code)
    assert words in text
    assert bool(list(machine.glob("cache/**/ccx"))) == (code == 0)
    assert ccx is not None or (text.count("\n") == 1 and "BUBBLEFIT_CCX" in text)
