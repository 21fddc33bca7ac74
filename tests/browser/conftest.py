"""One Chromium of the system for all pages, driven by playwright; skipped with a reason where either is missing."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

CHROMIUM = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
GRAPHICS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium on the PATH (Debian: apt-get install chromium)")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install 'fcsim[browser]'")
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=GRAPHICS)


@pytest.fixture
def visited(browser):
    """(file, width, height, colours) -> the page, ready, with what it `said` as errors and `asked` for beyond its own data."""

    @contextmanager
    def visit(file: Path, width: int = 1280, height: int = 900, scheme: str = "light") -> Iterator:
        page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        page.said, page.asked = [], []
        page.on("console", lambda message: page.said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: page.said.append(str(error)))
        page.on("request", lambda asked: page.asked.append(asked.url) if not asked.url.startswith(("data:", "blob:")) else None)
        page.goto(file.resolve().as_uri())
        page.wait_for_selector("html[data-ready]", timeout=120_000)
        yield page
        page.close()

    return visit
