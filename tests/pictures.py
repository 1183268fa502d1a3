"""One signal of the HTML page of a diff or of a comparison: python -m tests.pictures PAGE SIGNAL PICTURE."""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright


def take(page: Path, signal: str, picture: Path) -> None:
    """Open a signal on the page and save what is seen of it; needs Debian's `chromium`."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1000, "height": 800})
        opened.goto(page.absolute().as_uri())
        box = opened.locator("details.signal").filter(has=opened.get_by_text(signal, exact=True))
        if not box.evaluate("details => details.open"):
            box.locator("summary").click()
        box.screenshot(path=picture)
        browser.close()


if __name__ == "__main__":
    take(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
