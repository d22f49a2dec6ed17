"""Pictures of the report pages for README and docs/report.md: `scripts/report_pictures.py ZONE CYCLE OTHER SWEEP` in a headless Chromium.

ZONE, CYCLE: directories of the shipped cases' runs; OTHER: a run of the zone to compare; SWEEP: the directory of a sweep.
Writes docs/figures/report_*.png. Needs Chromium and the packages of the extra `dev`.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from mpm.page import report

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
WIDTH, TALLEST = 1240, 1290


def picture(browser: Any, page_file: Path, name: str, sections: tuple[str, ...], script: str = "") -> None:
    """The page from its top down to the last of `sections`, at most TALLEST pixels of it."""
    page = browser.new_page(viewport={"width": WIDTH, "height": TALLEST})
    page.goto(page_file.resolve().as_uri())
    page.wait_for_function("document.body.dataset.ready", timeout=120_000)
    if script:
        page.evaluate(script)
        page.wait_for_timeout(1500)
    boxes = [page.locator(section).first.bounding_box() for section in sections]
    top = min(box["y"] for box in boxes)
    bottom = max(box["y"] + box["height"] for box in boxes)
    shot = FIGURES / f"{name}.png"
    page.screenshot(
        path=str(shot),
        full_page=True,
        clip={"x": 0, "y": max(top - 8, 0), "width": WIDTH, "height": min(bottom - top + 16, TALLEST)},
    )
    page.close()
    print(shot, shot.stat().st_size, "bytes")


def main(zone: str, cycle: str, other: str, sweep: str) -> None:
    """Draw all four."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        streams = "(async () => { viewers[0].streams.checked = true; await viewers[0].draw(true); })()"
        picture(browser, report(zone), "report_zone", ("header", "#strip", "#fields"))
        picture(browser, report(zone), "report_numbers", ("#numbers", "#balance"))
        picture(browser, report(cycle), "report_cycle", ("header", "#strip", "#fields"), streams)
        two = report([zone, other], Path(folder) / "two.html")
        picture(browser, two, "report_two", ("header", "#keys", "#numbers"))
        picture(browser, two, "report_difference", ("#fields",))
        picture(browser, report(sweep), "report_sweep", ("header", "#axes", "#maps"))
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
