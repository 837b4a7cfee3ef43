"""A real browser without a screen, for the tests of pages."""

import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager

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


@contextmanager
def opened(browser, server) -> Iterator:
    """The page of a server of `handpipe curves` or `handpipe bones`; no request may leave this computer."""
    wrong: list[str] = []
    with server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        context = patient(browser.new_context(viewport={"width": 1100, "height": 750}))
        page = context.new_page()
        local = (server.address, "data:", "blob:")
        page.on("request", lambda r: None if r.url.startswith(local) else wrong.append(r.url))
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(server.address)
        page.wait_for_selector("body[data-ready=yes]")
        yield page
        context.close()
        server.shutdown()
        thread.join()
    assert wrong == []


def settled(page) -> None:
    """Every edit of such a page is answered and drawn."""
    editor = "document.querySelector('main').page.editor"
    page.evaluate(
        f"async () => {{ while ({editor}.running) await {editor}.running;"
        "await new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r))); }"
    )
