"""A browser without a window, and pages that several tests look at."""

import os
import shutil
from pathlib import Path

import pytest

import mi_lcair

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 120_000  # milliseconds for a page or a tip, on a machine under load
COMPLETE = "html[data-complete=yes]"


def browser_path() -> str | None:
    """The browser to start: MI_LCAIR_BROWSER, one of the system, or None for playwright's own."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = [path for path in map(shutil.which, names) if path]
    return os.environ.get("MI_LCAIR_BROWSER") or next(iter(found), None)


@pytest.fixture(scope="session")
def chromium():
    """Chromium; the tests are skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        path = browser_path() or driver.chromium.executable_path
        if not Path(path).exists():
            pytest.skip("no Chromium; MI_LCAIR_BROWSER names one")
        started = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield started
        started.close()


class Visit:
    """A page in the browser, with the errors and requests that it made.

    cpu_s: CPU time of the page's main thread until all was drawn, s.
    """

    def __init__(self, browser, file, width=1280):
        self.errors, self.requests = [], []
        context = browser.new_context(viewport={"width": width, "height": 900})
        context.route("**/*", self.only_the_file)
        self.page = context.new_page()
        client = context.new_cdp_session(self.page)
        client.send("Performance.enable", {"timeDomain": "threadTicks"})
        self.page.on("console", self.heard)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.goto(Path(file).as_uri())
        self.page.wait_for_selector(COMPLETE, timeout=PATIENCE)
        self.context = context
        metrics = client.send("Performance.getMetrics")["metrics"]
        self.cpu_s = next(one["value"] for one in metrics if one["name"] == "TaskDuration")

    def only_the_file(self, route):
        url = route.request.url
        if url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            self.requests.append(url)
            route.abort()

    def heard(self, message):
        if message.type == "error":
            self.errors.append(message.text)

    def tip_at(self, x: float, y: float, heading: str) -> str:
        """The tip beside the pointer after the mouse has moved to a point of the window.

        It must begin with `heading` after a while: plotly looks where the mouse is only at times.
        """
        self.page.mouse.move(5, 5)  # away from every picture
        self.page.mouse.move(round(x), round(y))
        text = "(() => { const tip = document.getElementById('tip'); return tip.textContent })()"
        try:
            self.page.wait_for_function(
                "(heading) => { const tip = document.getElementById('tip'); "
                "return !tip.hidden && tip.textContent.startsWith(heading) }",
                arg=heading,
                timeout=PATIENCE,
                polling=50,
            )
        except Exception as error:
            found = self.page.evaluate(text)
            raise AssertionError(f"the tip does not begin with {heading!r}: {found!r}") from error
        return self.page.evaluate(text)


@pytest.fixture(scope="module")
def visit(chromium):
    """Function that opens a page and waits until it is drawn."""
    visits = []

    def opened(file, **options) -> Visit:
        visits.append(Visit(chromium, file, **options))
        return visits[-1]

    yield opened
    for one in visits:
        one.context.close()


@pytest.fixture(scope="session")
def airliner(tmp_path_factory):
    """Page of the airliner as `report` makes it, of few paths."""
    path = tmp_path_factory.mktemp("page") / "airliner.html"
    mi_lcair.report("a340_landing", path, parameters={"position": 3}, spp=8)
    return path
