"""Options and hooks of all tests; the fixtures of several folders are in `fixtures.py`."""

import gc
import os
import signal

import pytest

from .slow import longest_first, mark_slow
from .support import shared_work

# Stand-ins of solvers lie anywhere; tests of who may name a program take this away.
os.environ["BUBBLEFIT_PROGRAMS_FROM"] = os.sep

# A shell that starts a job in the background (`make test &`) has it ignore SIGINT, and every
# process of the job inherits that: tests that interrupt a command could not.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

#: Folder of the compiled modules that programs of the tests share, if any.
COMPILED = pytest.StashKey()


def pytest_addoption(parser):
    parser.addoption("--rewrite-golden", action="store_true", help="write tests/golden/ anew")
    parser.addoption("--only-golden", action="store_true", help="tests with a file there alone")


def pytest_configure(config):
    keeps = config.pluginmanager.hasplugin("cacheprovider")
    config.stash[COMPILED] = shared_work.share_compiled_modules(keeps)
    # Only now, as each process of a run would compile for seconds what it imports before.
    from . import fixtures

    config.pluginmanager.register(fixtures)


def pytest_unconfigure(config):
    if folder := config.stash.get(COMPILED, None):
        shared_work.forbid_compiled_modules(folder)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collect without a look for garbage, of which there is none: that takes a seventh longer."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Have each process of a run begin with other files of a folder than the others do."""
    report = yield
    if isinstance(collector, pytest.Directory) and report.passed:
        report.result = shared_work.rotated(report.result)
    return report


def pytest_collection_modifyitems(config, items):
    mark_slow(items)
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: item.path)  # in each process alike
        longest_first(items)
    if config.getoption("--only-golden"):
        items[:] = [item for item in items if "golden" in getattr(item, "fixturenames", ())]
