"""Programs of a test: files that can be run."""

import stat
import subprocess


def program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def output_of(*command, **how):
    """Return what a command prints that has to end well."""
    done = subprocess.run(command, capture_output=True, text=True, **how)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout
