"""Take the picture of docs/report.md: the page of three trackers on the bundled sample.

    python docs/figures/report.py

runs `fdsst`, `kcf` and `mosse` without and with two enhancers on `night_mini`, makes the page, and
writes `report.png` beside this file. It needs playwright and Debian's chromium.
"""

import shutil
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from nat2024.cli import run

HERE = Path(__file__).parent
TRACKERS, ENHANCERS = ("fdsst", "kcf", "mosse"), ("none", "clahe", "gamma")
SIZE = {"width": 1180, "height": 1080}


def main() -> None:
    """Run, make the page, keep what is seen first."""
    with tempfile.TemporaryDirectory() as folder:
        results, out = Path(folder) / "results", Path(folder) / "report"
        words = [word for tracker in TRACKERS for word in ("--tracker", tracker)]
        words += [word for enhancer in ENHANCERS for word in ("--enhancer", enhancer)]
        status = run(["run", *words, "--results", str(results), "--quiet"])
        status = status or run(["report", "--results", str(results), "--out", str(out)])
        if status:
            sys.exit(status)
        take(out / "index.html", HERE / "report.png")


def take(page: Path, picture: Path) -> None:
    """Open the page and keep the window."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        tab = browser.new_page(viewport=SIZE)
        tab.goto(page.as_uri())
        tab.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    main()
