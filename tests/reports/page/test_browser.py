"""The page in headless Chromium: what people do with it, and that it stays by itself."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from nat2024_reports.page import DatasetPart, Page, build_page

pytestmark = pytest.mark.browser
api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BAD = '"><img src=x onerror=window.hit=1></script><script>window.hit=1</script>'


class Tab:
    """One tab of the browser with everything that it said and asked for."""

    def __init__(self, tab: Any, folder: Path) -> None:
        self.tab, self.folder = tab, folder
        self.said: list[str] = []
        self.asked: list[str] = []
        tab.on("console", lambda message: self.said.append(message.text))
        tab.on("pageerror", lambda error: self.said.append(str(error)))
        tab.on("request", lambda request: self.asked.append(request.url))
        for name in ("locator", "get_by_label", "get_by_role", "title"):
            setattr(tab, name, self.settled(getattr(tab, name)))

    def settled(self, find: Callable[..., Any]) -> Callable[..., Any]:
        """Look only at what the page has drawn for its present address."""

        def found(*args: Any, **options: Any) -> Any:
            for _ in range(500):  # the page's policy forbids `wait_for_function`
                if self.tab.evaluate("document.body.dataset.shown === location.hash"):
                    break
                self.tab.wait_for_timeout(10)
            return find(*args, **options)

        return found

    def open(self, name: str = "small", words: str = "") -> Any:
        address = (self.folder / f"{name}.html").as_uri()
        self.tab.goto("about:blank")
        self.tab.goto(f"{address}#{words}" if words else address)
        return self.tab

    def column(self, table: str, number: int) -> list[str]:
        cells = self.tab.locator(f'[data-table="{table}"] tbody tr > :nth-child({number})')
        return [text.strip() for text in cells.all_inner_texts()]

    @property
    def words(self) -> str:
        self.tab.locator("main")
        return str(self.tab.evaluate("decodeURIComponent(location.hash.slice(1))"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("no Chromium on this machine; Debian's package is chromium")
    with api.sync_playwright() as driver:
        started = driver.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--disable-gpu"], env=dict(os.environ)
        )
        yield started
        started.close()


@pytest.fixture(scope="module")
def pages(
    tmp_path_factory: pytest.TempPathFactory,
    small_page: Page,
    make_dataset: Callable[..., DatasetPart],
) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    hostile = make_dataset(
        BAD, trackers=(BAD, "b"), sequences=(BAD, "c", "d"), attribute=BAD, remarks=(BAD,)
    )
    (folder / "small.html").write_text(build_page(small_page))
    (folder / "hostile.html").write_text(build_page(Page(BAD, (hostile,), remarks=(BAD,))))
    return folder


@pytest.fixture(scope="module")
def shared_tab(browser: Any, pages: Path) -> Iterator[Tab]:
    context = browser.new_context(viewport={"width": 1200, "height": 900})
    tab = context.new_page()
    tab.set_default_timeout(20_000)
    yield Tab(tab, pages)
    context.close()


@pytest.fixture
def page(shared_tab: Tab) -> Iterator[Tab]:
    shared_tab.said.clear()
    shared_tab.asked.clear()
    yield shared_tab
    assert shared_tab.said == []
    assert [url for url in shared_tab.asked if not url.startswith(("file:", "data:"))] == []


def test_loads_with_every_part_and_asks_nobody(page: Tab) -> None:
    tab = page.open()
    titles = tab.locator("h2").all_inner_texts()
    assert titles == [
        "All sequences",
        "Curves: all sequences",
        "Gains in success",
        "Attributes and categories",
        "Sequences (3)",
        "Losses (3)",
        "Gain against light",
    ]
    assert tab.locator(".panels .curve").count() == 18
    assert tab.locator("#static").count() == 0
    assert {url.split("#")[0] for url in page.asked if url.startswith("file:")} == {
        (page.folder / "small.html").as_uri()
    }
    assert tab.evaluate("fetch('https://example.org').then(() => 'out', () => 'in')") == "in"
    page.said.clear()  # the browser tells that the policy has stopped it


def test_fields_of_the_controls_stand_in_one_row(page: Tab) -> None:
    fields = page.open().locator(".controls label").locator("select, input")
    boxes = [field.bounding_box() for field in fields.all()]
    assert len(boxes) > 3
    assert len({(box["y"], box["height"]) for box in boxes}) == 1


def test_sorting_by_click_and_back(page: Tab) -> None:
    tab = page.open()
    assert page.column("scores", 4)[0] == "0.300"
    tab.get_by_role("button", name="Success", exact=True).click()
    heading = tab.locator('[data-table="scores"] th', has_text="Success").first
    assert heading.get_attribute("aria-sort") == "descending"
    assert page.column("scores", 4) == ["0.550", "0.500", "0.450", "0.400", "0.350", "0.300"]
    tab.keyboard.press("Enter")  # the heading has kept the focus
    assert page.column("scores", 4)[0] == "0.300"
    assert heading.get_attribute("aria-sort") == "ascending"
    assert page.words == "sort=scores:success_auc:up"
    tab.go_back()
    assert page.column("scores", 4)[0] == "0.550"


def test_filters_reach_every_part(page: Tab) -> None:
    tab = page.open()
    tab.get_by_label("Tracker", exact=True).select_option("beta")
    tab.get_by_label("Sequences", exact=True).select_option("attribute:FM")
    assert set(page.column("scores", 2)) == {"beta"}
    assert page.column("scores", 4)[0] == "0.460"
    assert tab.locator("h2").first.inner_text() == "Attribute FM\u2020"
    assert tab.locator(".panels .curve").count() == 9
    assert len(page.column("sequences", 1)) == 2
    tab.get_by_label("Protocol", exact=True).select_option("strict")
    assert page.column("scores", 4)[0] == "0.560"
    tab.get_by_label("Find a sequence", exact=True).press_sequentially("bi")
    assert page.column("sequences", 1) == ["bike1"]
    assert tab.evaluate("document.activeElement.name") == "find"
    tab.get_by_role("button", name="Reset").click()
    assert page.words == ""
    assert len(page.column("scores", 2)) == 6


def test_gains_tell_what_could_be_chance(page: Tab) -> None:
    tab = page.open()
    texts = page.column("scores", 5)
    assert texts[0] == ""
    assert texts[1:3] == ["~\u2009+16.7", "+16.7"]
    assert tab.locator(".interval .dot.open").count() == 2
    assert page.column("gains", 9)[0] == "2 of 3"


def test_another_dataset_with_one_run(page: Tab) -> None:
    tab = page.open(words="off=alpha%2Bclahe")
    tab.get_by_label("Dataset", exact=True).select_option("day")
    assert page.words == "dataset=day"
    assert page.column("scores", 2) == ["alpha"]
    assert "No gain to show" in tab.locator("#part-gains").inner_text()


def test_rows_and_curves_light_each_other(page: Tab) -> None:
    tab = page.open()
    row = tab.locator('[data-table="scores"] tbody tr').nth(1)
    row.hover()
    assert tab.locator(".curve.lit").count() == 3
    assert set(tab.locator(".curve.lit").evaluate_all("n => n.map(x => x.dataset.run)")) == {"1"}
    tab.locator(".panels .reach").first.dispatch_event("pointerenter")
    lit = tab.locator('[data-table="scores"] tr.lit').get_attribute("data-run")
    assert lit == "5"
    tab.locator(".panels .reach").first.hover(force=True)
    assert tab.locator(".reading").first.inner_html().startswith("beta + ldenhancer: 0.")
    tab.locator(".ranks button").first.click()
    assert tab.locator(".panels .curve").count() == 15
    assert page.words == "off=beta+ldenhancer"


def test_a_sequence_by_keyboard_and_back(page: Tab) -> None:
    tab = page.open()
    first = tab.locator('[data-table="sequences"] tbody tr').first
    first.focus()
    tab.keyboard.press("ArrowDown")
    tab.keyboard.press("Enter")
    assert page.words == "sequence=car2"
    assert tab.locator(":focus").get_attribute("id") == "title-sequence"
    assert tab.locator(".timeline .curve").count() == 13  # overlap and error of 6 runs, light
    assert tab.locator(".gallery image").count() == 2
    assert tab.locator(".gallery rect").count() == 13
    assert tab.locator(".loss").count() == 2
    assert tab.title() == "car2 \u2013 Night tracking"
    tab.locator(".timeline").focus()
    tab.keyboard.press("Home")
    tab.keyboard.press("ArrowRight")
    assert (
        tab.locator(".reading-line").inner_text().startswith("Frame 1: ")
    )  # counted from 0, as in tables and files
    tab.keyboard.press("Escape")
    assert page.words == ""
    focused = tab.evaluate("document.activeElement.dataset.focus")
    assert focused == "sequence-car2"
    tab.go_back()
    assert tab.locator("h2").first.inner_text() == "car2"


def test_a_link_restores_everything(page: Tab) -> None:
    words = "sequence=bike1&run=beta&off=alpha&frame=13&metric=precision_20&protocol=strict"
    tab = page.open(words=words)
    assert tab.locator("#title-sequence").inner_text() == "bike1"
    assert tab.locator(".timeline .curve").count() == 11
    assert tab.locator(".reading-line").inner_text().startswith("Frame 13: ")
    assert tab.get_by_label("Protocol", exact=True).input_value() == "strict"
    assert tab.locator(".curve.lit").first.get_attribute("data-run") == "3"
    tab.get_by_role("link", name="All sequences").click()
    assert tab.get_by_label("Score", exact=True).input_value() == "precision_20"
    assert tab.locator(".panels .curve").count() == 15


def test_a_link_to_nothing_says_so(page: Tab) -> None:
    tab = page.open(words="sequence=%3Cb%3Egone&dataset=none&sort=scores&metric=x&frame=z")
    assert "There is no sequence <b>gone in night." in tab.locator("#view").inner_text()
    assert len(page.column("scores", 2)) == 6


def test_correlation_counts_a_sequence_once(page: Tab) -> None:
    caption = page.open().locator("#title-light ~ figure figcaption").inner_text()
    assert "over 3 sequences, gains averaged over the runs shown: " in caption
    assert "(too few to tell)" in caption


def test_light_and_dark(page: Tab) -> None:
    tab = page.open()

    def paper() -> str:
        return str(tab.evaluate("getComputedStyle(document.documentElement).backgroundColor"))

    assert paper() == "rgb(255, 255, 255)"
    tab.emulate_media(color_scheme="dark")
    assert paper() == "rgb(21, 23, 26)"
    tab.emulate_media(color_scheme="light")
    tab.get_by_role("button", name="Dark colours").click()
    assert paper() == "rgb(21, 23, 26)"
    tab.get_by_role("button", name="Light colours").click()
    assert paper() == "rgb(255, 255, 255)"
    tab.evaluate("localStorage.clear()")


def test_print_shows_tables_whole_and_no_controls(page: Tab) -> None:
    tab = page.open()
    tab.emulate_media(media="print")
    assert tab.locator('[data-table="scores"]').is_visible()
    assert tab.locator('[data-table="sequences"]').is_visible()
    assert not tab.locator(".controls").is_visible()
    box = tab.locator('[data-table="sequences"]').locator("..")
    assert box.evaluate("node => getComputedStyle(node).overflowY") == "visible"
    tab.emulate_media(media="screen")


def test_a_telephone_needs_no_sideways_scrolling(page: Tab) -> None:
    tab = page.open()
    tab.set_viewport_size({"width": 390, "height": 800})
    for words in ("", "sequence=bike1"):
        page.open(words=words)
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    tab.set_viewport_size({"width": 1200, "height": 900})


def test_hostile_names_are_only_shown(page: Tab) -> None:
    tab = page.open("hostile")
    assert tab.locator("h1").inner_text() == BAD
    assert BAD in page.column("scores", 2)
    assert BAD in page.column("sequences", 1)
    tab.locator('[data-table="sequences"] tbody tr').first.click()
    assert tab.locator("#title-sequence").inner_text() == BAD
    assert tab.evaluate("window.hit") is None
    assert tab.locator("img").count() == 0
    tab.reload()
    assert tab.locator("#title-sequence").inner_text() == BAD


def test_without_scripts_the_scores_are_there(browser: Any, pages: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto((pages / "small.html").as_uri())
    assert tab.locator("table.scores").count() == 2
    assert "Scripts are switched off" in tab.locator("#static").inner_text()
    context.close()


@pytest.mark.parametrize("value", [BAD, "__proto__", "constructor", "-1", "1e9:x:down"])
def test_words_of_the_address_are_never_html_or_code(page: Tab, value: str) -> None:
    single = "dataset subset protocol metric cells tracker enhancer find light run sequence frame"
    for keys in (single.split(), ["sort", "off"], ["sequence"], ["dataset"], ["metric"]):
        tab = page.open("hostile", "&".join(f"{key}={quote(value, safe='')}" for key in keys))
        assert tab.locator("main").inner_text()
        assert tab.evaluate("window.hit") is None
        assert tab.locator("main img").count() == 0
