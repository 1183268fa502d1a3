"""Nights of any size: the page and the summary stay small, whatever their scenarios are called and say."""

import json
import shutil

import pytest
from playwright.sync_api import sync_playwright

from replay.batch.report_index import index
from replay.batch.report_summary import summary
from replay.batch.reports import describe
from tests.batch import made_nights

MOST = 2_000_000
"""Bytes of the page of 10 000 scenarios that all differ."""


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    folder = tmp_path_factory.mktemp("large")
    night = made_nights.regression(10_000, folder)
    page = index(night, made_nights.past(10_000, nights=5))
    (folder / "index.html").write_text(page)
    return folder, night, page


def test_the_page_of_ten_thousand_is_small_and_so_is_the_summary(large):
    _, night, page = large
    assert len(page.encode()) <= MOST
    text = summary(night)
    assert len(text) < 20_000
    assert text.startswith("# 10000 of 10000 scenarios need attention\n")
    assert "and 81 more groups" in text and "and 9980 more scenarios" in text


def test_of_many_scenarios_the_terminal_tells_the_groups_and_of_few_each():
    lines = describe(made_nights.regression(404))
    assert len(lines) == 32
    assert lines[0].startswith(
        "4 scenarios: unexplained: inputs, model, libraries and code are the same; at worst carm"
    )
    assert lines[1].startswith("4 scenarios: person/part_7 radius 20 -> 28 cm; at worst carm_sweep[")
    assert "contact" not in lines[1] and ": broken: " in lines[1]
    assert lines[-2:] == ["and 71 more groups", "404 scenarios: 403 different, 1 broken"]
    few = describe(made_nights.regression(30))
    assert [": broken: " in line for line in few] == [True, *[False] * 30]


def test_ten_thousand_rows_are_searched_and_shown_a_part_at_a_time(large):
    folder, _, _ = large
    chromium = shutil.which("chromium")
    assert chromium, "this test needs a browser (Debian: apt-get install chromium)"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 400, "height": 900})
        errors = []
        page.on("console", lambda message: errors.append(message.text))
        page.goto((folder / "index.html").as_uri())
        ready = page.wait_for_selector("html[data-ready]", state="attached").get_attribute("data-ready")
        print(f"opened in {ready} ms, {json.dumps(page.evaluate('performance.getEntriesByType(`navigation`)[0]'))}")
        assert page.locator(".scenario").count() == 30
        assert page.locator("#status").inner_text() == "10000 of 10000 scenarios, 30 shown"
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        page.locator(".scenario").last.scroll_into_view_if_needed()
        page.locator("#more").scroll_into_view_if_needed()
        page.wait_for_function("document.querySelectorAll('.scenario').length >= 130")
        page.locator("#search").fill("arm=120deg person=3")
        assert page.locator("#status").inner_text().startswith("7 of 10000")
        page.locator("#search").fill("")
        page.locator("#group").select_option("0")
        assert page.locator("#status").inner_text() == "99 of 10000 scenarios, 30 shown"
        browser.close()
    assert errors == []
