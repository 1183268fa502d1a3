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
        opened.wait_for_selector("html[data-ready]")
        yield opened
        browser.close()


def shown(page):
    return [row.get_attribute("class").split()[1] for row in page.locator(".scenario").all() if row.is_visible()]


def test_counts_come_first_and_what_fails_before_what_does_not(page):
    assert page.locator("h1").inner_text() == "3 of 4 scenarios need attention"
    assert "all 4" in page.locator(".filters").inner_text()
    assert shown(page) == ["BROKEN", "DIFFERENT", "MISSING", "SAME"]
    assert page.requests == [page.url]
    assert page.errors == []


def test_causes_are_told_first_and_a_button_shows_their_scenarios(page):
    texts = [group.inner_text().split("\n")[0] for group in page.locator(".group").all()]
    assert texts == [
        "1 scenario: expect[0].contact never -> always",
        "1 scenario: wall/slab pose.xyz[0] 1.2 -> 1.25 m",
        "1 scenario: no baseline yet",
    ]
    page.locator(".group button").nth(1).click()
    assert shown(page) == ["DIFFERENT"]
    page.locator("#group").select_option("")
    assert len(shown(page)) == 4


def test_names_are_shown_and_not_run(page):
    assert "<script>document.title=1<script>" in page.locator(".MISSING summary").first.inner_text()
    assert page.title() == "3 of 4 scenarios need attention"


def test_filters_by_mouse_and_by_keyboard(page):
    page.get_by_text("needing attention 3").click()
    assert shown(page) == ["BROKEN", "DIFFERENT", "MISSING"]
    page.keyboard.press("ArrowRight")
    assert shown(page) == ["DIFFERENT"]
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    assert len(shown(page)) == 4


def test_search_and_severity(page):
    page.locator("body").press("/")
    page.keyboard.type("distance fails")
    assert shown(page) == []
    page.keyboard.press("Escape")
    assert len(shown(page)) == 4
    page.locator("#severity").select_option("reading")
    assert shown(page) == ["DIFFERENT"]
    page.locator("#severity").select_option("")
    page.locator("#tag").select_option("quick")
    assert len(shown(page)) == 4
    page.locator("#tag").select_option("")


def test_keys_walk_through_the_rows_and_open_one_with_its_plots(page):
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("j")
    page.keyboard.press("j")
    page.keyboard.press("Enter")
    frame = page.locator(".DIFFERENT iframe").content_frame
    signal = frame.locator(".signal").first
    plot = signal.locator("svg[role=img]")
    assert not plot.is_visible()
    signal.locator("summary").focus()
    page.keyboard.press("Enter")
    assert plot.is_visible()
    assert plot.locator("path.baseline, path.candidate").count() >= 2
    page.keyboard.press("Enter")
    assert not plot.is_visible()
    assert page.errors == []


def test_links_lead_to_files_that_are_there(page):
    pages = [link.evaluate("element => element.href") for link in page.locator(".group a").all()]
    assert len(pages) == 3
    for address in pages:
        inside = page.context.browser.new_page()
        inside.goto(address)
        links = [link.evaluate("element => element.href") for link in inside.locator("p a").all()]
        inside.close()
        assert len(links) >= 3
        for link in links:
            assert Path(unquote(urlparse(link).path)).is_file()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_text_has_the_contrast_that_the_web_asks_for(page, scheme):
    page.emulate_media(color_scheme=scheme)
    found = page.evaluate(CONTRASTS)
    page.emulate_media(color_scheme="light")
    assert len(found) > 20
    assert min(ratio for ratio, _ in found) >= 4.5, min(found)


CONTRASTS = """() => {
  const number = text => text.match(/[\\d.]+/g).map(Number);
  const linear = c => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  const over = ([r, g, b, a = 1], [x, y, z]) => [r * a + x * (1 - a), g * a + y * (1 - a), b * a + z * (1 - a)];
  const canvas = matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
  const found = [];
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some(node => node.nodeType === 3 && node.textContent.trim());
    if (!own || !element.checkVisibility()) continue;
    let behind = canvas, opacity = 1;
    const above = [];
    for (let e = element; e; e = e.parentElement) above.unshift(e);
    for (const e of above) {
      const style = getComputedStyle(e);
      behind = over(number(style.backgroundColor), behind);
      opacity *= Number(style.opacity);
    }
    const [r, g, b, a = 1] = number(getComputedStyle(element).color);
    const text = over([r, g, b, a * opacity], behind);
    const [low, high] = [light(text), light(behind)].sort((x, y) => x - y);
    found.push([(high + 0.05) / (low + 0.05), element.outerHTML.slice(0, 80)]);
  }
  return found;
}"""
