"""Seconds until the page of a run shows its bodies, in a Chromium of its own each time, drawn by the processor (no graphics card).

    fcsim run masonry_wall --out DIR && fcsim render DIR --page
    python benchmarks/first_picture.py DIR                             the widths 1280 and 390 in turns, seven times each
    python benchmarks/first_picture.py DIR OTHER --repeat 15           two pages in turns

From the call of the page to the instant after the graphics card has finished the frame, by the clock: for a machine without other work.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
from pathlib import Path

SIZES = {1280: 900, 390: 844}
"""[pixels] Width to height of the window."""
GRAPHICS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
FINISHED = """{
    const mark = performance.mark.bind(performance);
    performance.mark = name => {
        const canvas = document.querySelector("#view canvas"), gl = canvas && canvas.getContext("webgl");
        if (gl) {
            gl.bindFramebuffer(gl.FRAMEBUFFER, null);
            gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        }
        return mark(name);
    };
}"""
"""Before the page says that its first picture is there, a pixel is read: that waits for what the card has been told to draw."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", metavar="DIR", type=Path, nargs="+", help="folder of a run with page.html")
    parser.add_argument("--repeat", type=int, default=7, help="times each page is opened at each width (default 7)")
    given = parser.parse_args()
    chromium = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None)
    if chromium is None:
        sys.exit("no Chromium on the PATH (Debian: apt-get install chromium)")
    pages = [run / "page.html" for run in given.runs]
    missing = [page for page in pages if not page.is_file()]
    if missing:
        sys.exit(f"{missing[0]} is not there: fcsim render {missing[0].parent} --page writes it")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sys.exit("playwright is not installed: pip install 'fcsim[browser]'")
    seconds: dict[tuple[Path, int], list[float]] = {(page, width): [] for page in pages for width in SIZES}
    with sync_playwright() as playwright:
        for _ in range(given.repeat):
            for page, width in seconds:
                browser = playwright.chromium.launch(executable_path=chromium, args=GRAPHICS)
                tab = browser.new_page(viewport={"width": width, "height": SIZES[width]})
                tab.add_init_script(FINISHED)
                tab.goto(page.resolve().as_uri(), wait_until="commit")
                tab.wait_for_function("performance.getEntriesByName('first picture').length > 0", timeout=120_000, polling=10)
                seconds[page, width].append(tab.evaluate("performance.getEntriesByName('first picture')[0].startTime / 1e3"))
                browser.close()
    for (page, width), found in seconds.items():
        spread = f"median {statistics.median(found):.2f} s, {min(found):.2f} to {max(found):.2f} s"
        print(f"{page}, {page.stat().st_size / 1e6:.1f} MB, {width} pixels: {spread}")


if __name__ == "__main__":
    main()
