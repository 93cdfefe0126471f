"""A page on paper: report.pdf, printed by a browser that is here."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from ..errors import OutputError
from ..files import replacing

#: Programs that print pages, in the order in which they are looked for.
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome",
            "microsoft-edge")  # fmt: skip
#: Seconds that a browser may take, and milliseconds that the page's own script gets.
PATIENCE, SCRIPT = 180, 10000


def find_browser() -> str | None:
    """Path of a browser, None where there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def browser_command(browser: str, home: Path) -> list[str]:
    """What every call of a browser begins with: no window, no network, a home of its own."""
    # As root, as in a container, it starts only without its sandbox; the page is our own.
    bare = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    return [
        browser, "--headless=new", "--disable-gpu", *bare, f"--user-data-dir={home}",
        # A container's shared memory may be too small for a page.
        "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND", f"--virtual-time-budget={SCRIPT}",
    ]  # fmt: skip


def print_page(page: Path, path: Path) -> Path:
    """Print a page on A4 as PDF.

    Raises
    ------
    OutputError : there is no browser, it fails, or the file cannot be written.
    """
    browser = find_browser()
    if browser is None:
        said = f"needs a browser to print with, and there is none of {', '.join(BROWSERS)}"
        raise OutputError(f"{path}: {said}; install chromium, or print {page} from any browser")
    with replacing(path) as temporary, tempfile.TemporaryDirectory() as home:
        command = browser_command(browser, Path(home))
        command += ["--no-pdf-header-footer", f"--print-to-pdf={temporary.resolve()}"]
        try:
            done = subprocess.run(
                [*command, page.resolve().as_uri()], capture_output=True, timeout=PATIENCE
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise OutputError(f"{path}: {browser} failed: {error}") from None
        if done.returncode or not temporary.exists():
            last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            raise OutputError(f"{path}: {browser} printed nothing: {' '.join(last)}")
    return path
