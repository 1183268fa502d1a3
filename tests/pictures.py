"""The README's pictures that are not of the viewer: python -m tests.pictures signal PAGE SIGNAL PICTURE, or
python -m tests.pictures reaction RECORDINGS PICTURE."""

import json
import re
import shutil
import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
from playwright.sync_api import sync_playwright


def signal(page: Path, name: str, picture: Path) -> None:
    """Open a signal on a diff's page and save what is seen of it; needs Debian's `chromium`."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1000, "height": 800})
        opened.goto(page.absolute().as_uri())
        box = opened.locator("details.signal").filter(has=opened.get_by_text(name, exact=True))
        if not box.evaluate("details => details.open"):
            box.locator("summary").click()
        box.screenshot(path=picture)
        browser.close()


def reaction(recordings: Path, picture: Path) -> None:
    """Draw how far the table goes and what clearance is left over the reaction time, with a table of the numbers."""
    found = []
    for file in recordings.glob("carm_bodyguard_reaction*/result.json"):
        delay = float(re.search(r"reaction=(\d+)ms", file.parent.name).group(1))
        stop = json.loads(file.read_text())["guards"][0]
        found.append((delay, 1e3 * stop["joints"][0]["stopping_distance"], 1e3 * stop["clearance_at_stop"]))
    delays, ways, left = zip(*sorted(found), strict=True)
    mpl.use("Agg")
    figure, (chart, below) = plt.subplots(2, figsize=(8, 4.4), height_ratios=(3, 1), layout="constrained")
    chart.plot(delays, left, "o-", color="#0072b2", label="clearance that is left")
    chart.plot(delays, ways, "s-", color="#d55e00", label="stopping distance of the table")
    chart.set(xlabel="reaction time of the guard [ms]", ylabel="[mm]", ylim=(0, None))
    chart.grid(alpha=0.3)
    chart.legend(frameon=False)
    rows = [[f"{value:.1f}" for value in row] for row in (ways, left)]
    names = ["stopping distance [mm]", "clearance left [mm]"]
    below.axis("off")
    below.table(rows, rowLabels=names, colLabels=[f"{delay:g} ms" for delay in delays], loc="center", cellLoc="center")
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    if sys.argv[1] == "signal":
        signal(Path(sys.argv[2]), sys.argv[3], Path(sys.argv[4]))
    else:
        reaction(Path(sys.argv[2]), Path(sys.argv[3]))
