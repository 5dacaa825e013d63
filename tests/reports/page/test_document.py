"""The file as text: what is in it, what cannot be, and that it is the same each time."""

import base64
import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from nat2024_reports.figures.looks import NamedRun, views_of
from nat2024_reports.page import DatasetPart, Page, Run, Thumbnail, build_page
from nat2024_reports.page import payload as payload_module
from nat2024_reports.page.document import SCRIPTS, STYLES
from nat2024_reports.page.payload import page_payload, series_points
from nat2024_reports.page.styles import INK, run_styles
from nat2024_reports.style import BLACK, COLOURS

HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(2)>',
    "</script><script>alert(3)</script>",
    "<!--<script>",
    "it's {{ 7*7 }} & \u2028 \udcff",
)


def embedded(html: str, name: str) -> Any:
    found = re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', html, re.S)
    assert found is not None
    return json.loads(found[1])


def with_first(dataset: DatasetPart, **changes: Any) -> Page:
    """A page of the dataset with its first sequence changed."""
    first = dataclasses.replace(dataset.sequences[0], **changes)
    sequences = (first, *dataset.sequences[1:])
    return Page("t", (dataclasses.replace(dataset, sequences=sequences),))


def test_equal_input_gives_equal_bytes(small_page: Page) -> None:
    assert build_page(small_page) == build_page(small_page)


def test_policy_lets_only_this_style_and_script_in(small_page: Page) -> None:
    html = build_page(small_page)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; ")
    assert "unsafe" not in policy[1]
    for kind, pattern in (
        ("script", r"<script>(.*?)</script>"),
        ("style", r"<style>(.*?)</style>"),
    ):
        (text,) = re.findall(pattern, html, re.S)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy[1]


def test_the_file_names_no_place_in_the_network(small_page: Page) -> None:
    addresses = set(re.findall(r"(?:https?:)?//[a-z][\w.]+", build_page(small_page)))
    assert addresses == {"http://www.w3.org"}  # the name of the SVG language, which nobody loads


def test_scripts_read_no_text_as_html_or_code() -> None:
    folder = files("nat2024_reports.page")
    names = {entry.name for entry in (folder / "script").iterdir()}
    assert names == {f"{name}.js" for name in SCRIPTS}
    assert {entry.name for entry in (folder / "style").iterdir()} == {f"{n}.css" for n in STYLES}
    for name in SCRIPTS:
        text = (folder / "script" / f"{name}.js").read_text()
        for word in (
            "innerHTML",
            "outerHTML",
            "insertAdjacent",
            "eval(",
            "document.write",
            "fetch(",
        ):
            assert word not in text, name
        assert len(text.splitlines()) < 200, name
        assert max(map(len, text.splitlines())) <= 120, name


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_stay_text(name: str, make_dataset: Callable[..., DatasetPart]) -> None:
    dataset = make_dataset(
        name, trackers=(name,), sequences=(name, "b", "c"), attribute=name, remarks=(name,)
    )
    html = build_page(Page(name, (dataset,), remarks=(name,)))
    assert re.findall(r"<script[^>]*>", html) == [
        '<script type="application/json" id="data">',
        *(f'<script type="application/json" id="sequence-0-{n}">' for n in range(3)),
        "<script>",
    ]
    assert "<img" not in html
    assert html.count("<!--") == 0
    data = embedded(html, "data")
    assert data["datasets"][0]["sequences"][0]["name"] == name.replace("\udcff", "?")
    html.encode()


def test_the_main_table_is_there_without_scripts(small_page: Page) -> None:
    html = build_page(small_page)
    before_scripts = html[: html.index("<script")]
    rows = re.findall(r"<tr><td>(\w+)</td><td>(.)</td>(.*?)</tr>", before_scripts)
    assert ("alpha", "\u2013") in {row[:2] for row in rows}
    assert '<td class="number">0.300</td>' in before_scripts
    assert before_scripts.count('<table class="scores">') == 2
    assert "one remark" in before_scripts


def test_scores_of_sequences_are_rounded_once(small_page: Page) -> None:
    small_page.datasets[0].protocols[0].per_sequence.loc[0, "success_auc"] = 0.24751
    first, _ = page_payload(small_page)
    grid = first["datasets"][0]["protocols"][0]["bySequence"]["success_auc"]
    assert f"{grid[0][0]:.3f}" == "0.248"  # of four decimals, 0.2475, it would be 0.247


def test_numbers_are_those_of_the_tables(small_page: Page) -> None:
    first, details = page_payload(small_page)
    night = first["datasets"][0]
    table = small_page.datasets[0].protocols[1].subsets[0].summary
    row = night["protocols"][1]["subsets"][0]["rows"][2]
    assert row["success_auc"] == pytest.approx(table["success_auc"][2])
    assert night["runs"][1]["base"] == 0
    assert night["runs"][0]["base"] is None
    gain = night["protocols"][0]["subsets"][0]["gains"]["success_auc"][0]
    assert (gain["run"], gain["gain"], gain["certain"]) == (1, 16.667, False)
    assert night["failures"]["rows"][1] == {"run": 0, "sequence": 1, "first_loss": 12}
    track = details["0-0"]["tracks"][0]
    overlap = np.frombuffer(base64.b64decode(track["overlap"]), np.uint8) / 254
    wanted = small_page.datasets[0].sequences[0].tracks["alpha"].overlap
    assert np.abs(overlap - wanted).max() < 0.003
    assert json.dumps([first, details], allow_nan=False)


def test_nan_curves_and_scores_are_gaps(make_dataset: Callable[..., DatasetPart]) -> None:
    dataset = make_dataset("night")
    protocol = dataset.protocols[0]
    subset = protocol.subsets[0]
    empty = dataclasses.replace(
        subset,
        summary=subset.summary.assign(success_auc=math.nan),
        curves=subset.curves.assign(value=math.nan),
        gains=None,
    )
    protocol = dataclasses.replace(protocol, subsets=(empty, *protocol.subsets[1:]))
    page = Page("t", (dataclasses.replace(dataset, protocols=(protocol,)),))
    first, _ = page_payload(page)
    shown = first["datasets"][0]["protocols"][0]
    assert shown["subsets"][0]["curves"] == {}
    assert "success_auc" not in shown["metrics"]
    assert shown["subsets"][0]["gains"] == {}
    build_page(page)


def test_long_series_are_shortened_so_that_all_stay_small(
    make_dataset: Callable[..., DatasetPart],
) -> None:
    dataset = make_dataset("night")
    assert series_points(Page("t", (dataset,))) == 1000
    sequence = dataset.sequences[0]
    track = sequence.tracks["alpha"]
    many = {str(i): track for i in range(40)}
    sequences = tuple(dataclasses.replace(sequence, tracks=many) for _ in range(135))
    crowded = Page("t", (dataclasses.replace(dataset, sequences=sequences),))
    assert series_points(crowded) == 277


def test_pictures_beyond_the_room_are_left_out_and_said(
    make_dataset: Callable[..., DatasetPart], monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = make_dataset("night")
    size = len(dataset.sequences[0].thumbnails[0].jpeg)
    monkeypatch.setattr(payload_module, "_PICTURE_BYTES", 4 * (size * 4 // 3))
    first, details = page_payload(Page("t", (dataset,)))
    counts = [len(details[f"0-{n}"]["pictures"]) for n in range(3)]
    assert counts == [2, 1, 1]  # the first of each before the second of any
    assert first["remarks"] == ["2 pictures are left out to keep this file small"]


def test_boxes_that_are_no_numbers_are_not_drawn(make_dataset: Callable[..., DatasetPart]) -> None:
    dataset = make_dataset("night")
    nan = (math.nan, 1.0, 2.0, 3.0)
    picture = Thumbnail(0, "worst", b"x", (0, 0, 4, 3), nan, {"alpha": nan, "gone": (1, 1, 1, 1)})
    sequence = dataclasses.replace(dataset.sequences[0], thumbnails=(picture,))
    _, details = page_payload(
        Page("t", (dataclasses.replace(dataset, sequences=(sequence, *dataset.sequences[1:])),))
    )
    (shown,) = details["0-0"]["pictures"]
    assert (shown["truth"], shown["boxes"]) == (None, {0: None})


def test_results_shorter_than_their_sequence_end_in_gaps(
    make_dataset: Callable[..., DatasetPart],
) -> None:
    dataset = make_dataset("night")
    sequence = dataclasses.replace(dataset.sequences[0], frames=45)
    _, details = page_payload(
        Page("t", (dataclasses.replace(dataset, sequences=(sequence, *dataset.sequences[1:])),))
    )
    raw = base64.b64decode(details["0-0"]["tracks"][0]["overlap"])
    assert raw[40:] == b"\xff" * 5


def test_a_page_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one dataset"):
        build_page(Page("t", ()))


def test_one_colour_a_tracker_dashed_without_an_enhancer() -> None:
    names = ("none", "clahe", "ldenhancer")
    runs = [Run(f"{t}{e}", t, e) for t in ("a", "b") for e in names]
    styles = [(style.color, style.dash) for style in run_styles(runs)]
    assert styles == [(0, 1), (0, 0), (0, 2), (1, 1), (1, 0), (1, 2)]


def test_a_single_tracker_has_one_colour_an_enhancer() -> None:
    styles = run_styles([Run("a", "a"), Run("a+c", "a", "c"), Run("a+d", "a", "d")])
    assert [(style.color, style.dash) for style in styles] == [(INK, 1), (0, 0), (1, 0)]
    with_one = run_styles([Run("a", "a"), Run("a+c", "a", "c")])
    assert [(style.color, style.dash) for style in with_one] == [(0, 1), (0, 0)]
    many = run_styles([Run("a", "a"), *(Run(f"a+{n}", "a", str(n)) for n in range(20))])
    assert len(set(many)) == 21


@pytest.mark.parametrize("enhancers", [(), ("c",), ("c", "d", "e")])
@pytest.mark.parametrize("trackers", ["a", "abc"])
def test_colours_are_those_of_the_figures(trackers: str, enhancers: tuple[str, ...]) -> None:
    runs = [Run(f"{t}{e}", t, e) for t in trackers for e in ("none", *enhancers)]
    named = [NamedRun(run.name, run.tracker, run.enhancer) for run in runs]
    drawn = views_of(named)[0].looks if len(trackers) == 1 or len(enhancers) < 2 else {}
    colors = {INK: BLACK, **dict(enumerate(COLOURS))}
    for run, style in zip(runs, run_styles(runs), strict=True):
        look = drawn.get(run.name)
        assert look is None or (colors[style.color], style.dash == 1) == (
            look.color,
            look.is_dashed,
        )


def test_plain_trackers_alone_are_solid() -> None:
    assert [style.dash for style in run_styles([Run("a", "a"), Run("b", "b")])] == [0, 0]
