"""The regression's page in a real browser: from disk, without network, with mouse and keyboard."""

import shutil
from pathlib import Path
from urllib.parse import unquote, urlparse

import pytest
from playwright.sync_api import sync_playwright

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("night")
    for name in ("same", "differs", "fails"):
        scenes.write(folder / "in", name)
    options = ["regress", str(folder / "in"), "--baseline", str(folder / "base"), "-o", str(folder / "out")]
    assert run([*options, "--missing-baseline", "create", "--rrd", "none"]) is ExitCode.FINE
    scenes.write(folder / "in", "differs", distance=1.25)
    scenes.write(folder / "in", "fails", contact="always")
    path = scenes.write(folder / "in", "new")
    path.write_text(path.read_text().replace("name: new", "name: '<script>document.title=1<script>'"))
    assert run([*options, "--rrd", "none"]) is ExitCode.FAILED
    chromium = shutil.which("chromium")
    assert chromium, "this test needs a browser (Debian: apt-get install chromium)"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        opened = browser.new_page(viewport={"width": 1100, "height": 900})
        opened.requests, opened.errors = [], []
        opened.on("request", lambda request: opened.requests.append(request.url))
        opened.on("console", lambda message: opened.errors.append(message.text))
        opened.goto((folder / "out" / "index.html").as_uri())
        yield opened
        browser.close()


def shown(page):
    return [row.get_attribute("class").split()[1] for row in page.locator(".scenario").all() if row.is_visible()]


def test_counts_come_first_and_what_fails_before_what_does_not(page):
    assert page.locator("h1").inner_text() == "3 of 4 scenarios need attention"
    assert "all 4" in page.locator(".filters").inner_text()
    assert shown(page) == ["DIFFERENT", "BROKEN", "MISSING", "SAME"]
    assert page.requests == [page.url]
    assert page.errors == []


def test_names_are_shown_and_not_run(page):
    assert "<script>document.title=1<script>" in page.locator(".MISSING summary").first.inner_text()
    assert page.title() == "3 of 4 scenarios need attention"


def test_filters_by_mouse_and_by_keyboard(page):
    page.get_by_text("needing attention 3").click()
    assert shown(page) == ["DIFFERENT", "BROKEN", "MISSING"]
    page.keyboard.press("ArrowRight")
    assert shown(page) == ["DIFFERENT"]
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    assert len(shown(page)) == 4


def test_a_signal_opens_its_plot_from_the_keyboard(page):
    signal = page.locator(".DIFFERENT .signal").first
    plot = signal.locator("svg[role=img]")
    assert not plot.is_visible()
    signal.locator("summary").focus()
    page.keyboard.press("Enter")
    assert plot.is_visible()
    assert plot.locator("path.baseline, path.candidate").count() >= 2
    page.keyboard.press("Enter")
    assert not plot.is_visible()


def test_links_lead_to_files_that_are_there(page):
    addresses = [link.evaluate("element => element.href") for link in page.locator(".scenario p a").all()]
    assert len(addresses) >= 10
    for address in addresses:
        assert Path(unquote(urlparse(address).path)).is_file()
