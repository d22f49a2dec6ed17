"""Pictures of the report pages for README and docs/report.md: `scripts/report_pictures.py ZONE CYCLE OTHER SWEEP` in a headless Chromium.

ZONE, CYCLE: directories of the shipped cases' runs; OTHER: a run of the zone to compare; SWEEP: the directory of a sweep.
Writes docs/figures/report_*.png. Needs Chromium and the packages of the extra `dev`.
"""

import io
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from mpm.page import report

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
WIDTH, GAP, BACK = 1240, 10, "#f3f5f8"


def picture(browser: Any, page_file: Path, name: str, sections: tuple[str, ...], script: str = "") -> None:
    """Sections of a page below each other."""
    page = browser.new_page(viewport={"width": WIDTH, "height": 900})
    page.goto(page_file.resolve().as_uri())
    page.wait_for_function("document.body.dataset.ready", timeout=120_000)
    if script:
        page.evaluate(script)
        page.wait_for_timeout(1500)
    parts = [Image.open(io.BytesIO(page.locator(section).first.screenshot())) for section in sections]
    whole = Image.new(
        "RGB",
        (max(part.width for part in parts) + 2 * GAP, sum(part.height + GAP for part in parts) + GAP),
        BACK,
    )
    at = GAP
    for part in parts:
        whole.paste(part, (GAP, at))
        at += part.height + GAP
    shot = FIGURES / f"{name}.png"
    whole.save(shot, optimize=True)
    page.close()
    print(shot, shot.stat().st_size, "bytes")


def main(zone: str, cycle: str, other: str, sweep: str) -> None:
    """Draw all four."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        streams = "(async () => { viewers[0].streams.checked = true; await viewers[0].draw(true); })()"
        picture(browser, report(zone), "report_zone", ("header", "#strip", "#verdict", "#fields"))
        picture(browser, report(zone), "report_numbers", ("#numbers", "#balance"))
        picture(browser, report(cycle), "report_cycle", ("header", "#strip", "#verdict", "#fields"), streams)
        two = report([zone, other], Path(folder) / "two.html")
        picture(browser, two, "report_two", ("header", "#keys", "#numbers"))
        picture(browser, two, "report_difference", ("#fields",))
        picture(browser, report(sweep), "report_sweep", ("header", "#axes", "#maps"))
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
