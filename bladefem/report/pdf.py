"""A report as PDF, printed by Chromium as its print dialogue would."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from bladefem.errors import InputError, NotSolvedError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
# a page of pictures prints in seconds
PATIENCE_SECONDS = 300


def browser_command() -> list[str] | None:
    """Chromium without a window; None where there is none. ``BLADEFEM_CHROMIUM`` names another."""
    found = [os.environ.get("BLADEFEM_CHROMIUM", ""), *BROWSERS]
    browser = next((path for name in found if name and (path := shutil.which(name))), None)
    if browser is None:
        return None
    # the sandbox needs user name spaces, which root in a container does not have
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
    return [browser, "--headless", "--disable-gpu", *sandbox]


def require_browser() -> list[str]:
    """As :func:`browser_command`.

    Raises:
        InputError: there is none.
    """
    command = browser_command()
    if command is None:
        raise InputError(
            f"--pdf: no Chromium was found, expected one of {', '.join(BROWSERS)} (Debian: apt "
            "install chromium); any browser prints the HTML page as well"
        )
    return command


def print_pdf(page: str | Path) -> Path:
    """Print a page next to it, under the same name.

    Raises:
        InputError: no such page, or no Chromium. NotSolvedError: it wrote nothing, or did not end.
    """
    page = Path(page).resolve()
    file = page.with_suffix(".pdf")
    if not page.is_file():
        raise InputError(f"{page}: there is no such report, expected one that a run has written")
    command = require_browser()
    with tempfile.TemporaryDirectory(prefix="bladefem-pdf-") as profile:
        printing = [
            *command,
            f"--user-data-dir={profile}",
            "--no-pdf-header-footer",
            f"--print-to-pdf={file}",
            page.as_uri(),
        ]
        file.unlink(missing_ok=True)
        try:
            done = subprocess.run(
                printing, capture_output=True, text=True, timeout=PATIENCE_SECONDS, check=False
            )
        except subprocess.TimeoutExpired:
            raise NotSolvedError(
                f"{page.name} was not printed: {command[0]} did not end in {PATIENCE_SECONDS} s"
            ) from None
    if not file.is_file():
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise NotSolvedError(f"{page.name} was not printed: {last}")
    return file
