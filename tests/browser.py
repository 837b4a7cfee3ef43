"""A real browser without a screen, for the tests of pages."""

import shutil
from collections.abc import Iterator

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SOFTWARE = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]  # no graphics card is needed
QUIET = ["--disable-quic", "--no-first-run", "--disable-component-update", "--disable-sync"]
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
PATIENCE = 120_000.0  # ms that a page may take on a busy machine


def patient(context):
    """A context of the browser whose pages are waited for on a busy machine."""
    context.set_default_timeout(PATIENCE)
    return context


def chromium() -> Iterator:
    """The browser while it runs."""
    with playwright.sync_playwright() as started:
        running = started.chromium.launch(
            executable_path=CHROMIUM, args=[*SOFTWARE, *QUIET, "--disable-background-networking"]
        )
        yield running
        running.close()
