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


def test_what_is_there_is_not_built_again(machine):
    ccx = program(
        machine / "cache" / "calculix" / "ccx-2.99-external" / "ccx",
        "#!/bin/sh\necho 'This is Version 2.99'\n",
    )
    assert f"{ccx} is there already" in build(machine, 0)


def test_without_apt_it_says_what_to_do(machine):
    text = build(machine, 1)
    assert text.count("\n") == 1
    assert "apt-get is not there" in text and "BUBBLEFIT_CCX" in text
    assert not list(machine.glob("cache/**/*"))


def test_a_ccx_that_does_not_run_any_more_is_not_taken(machine):
    program(machine / "cache" / "calculix" / "ccx-2.99-external" / "ccx", "#!/bin/sh\nexit 127\n")
    assert "does not run any more" in build(machine, 1)
    assert not list(machine.glob("cache/**/ccx"))


def test_without_a_compiler_it_says_what_to_do(machine):
    (machine / "bin" / "cc").unlink()
    assert "as root: apt-get install gcc" in build(machine, 1)
