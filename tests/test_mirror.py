"""Every long module has a test file of its name, or a reason why not: tests/mirror.py."""

from pathlib import Path

from . import mirror


def test_long_module_has_test_file_of_its_name_or_a_reason():
    missing = [
        module.as_posix()
        for module in mirror.modules_without_tests()
        if module.as_posix() not in mirror.REASONS
    ]
    assert missing == []


def test_reasons_are_few_and_none_is_stale():
    assert len(mirror.REASONS) <= 12
    assert {*mirror.REASONS} <= {path.as_posix() for path in mirror.modules_without_tests()}
    assert all(len(reason.split()) > 3 for reason in mirror.REASONS.values())


def test_test_file_of_a_module_a_package_and_the_package_itself():
    places = {
        "runs/folder.py": "tests/runs/test_folder.py",
        "experiments/bending/__init__.py": "tests/experiments/test_bending.py",
        "notes.py": "tests/test_notes.py",
        "__init__.py": "tests/test_bubblefit.py",
    }
    for module, file in places.items():
        assert mirror.test_file_of(Path(module)) == Path(file)


def test_module_without_test_file_is_found(tmp_path):
    for module in ("runs/long.py", "runs/short.py", "runs/kept.py", "docs/long.py"):
        path = tmp_path / module
        path.parent.mkdir(exist_ok=True)
        path.write_text("x = 1\n" * (3 if "short" in module else 101))
    test = tmp_path / "tests" / "runs" / "test_kept.py"
    test.parent.mkdir(parents=True)
    test.write_text("")
    assert mirror.modules_without_tests(tmp_path) == [Path("runs/long.py")]
