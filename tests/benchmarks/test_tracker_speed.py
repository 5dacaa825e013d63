"""The benchmark of trackers: what it measures, and its table."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import tracker_speed
from tracker_speed import MARKERS, Measured

LINE = Measured("siamrpnpp", 287, 1, 200.0, 50.0)


def test_only_trackers_with_a_plain_form_are_measured():
    names = tracker_speed.trackers_with_peers()
    assert {"siamrpnpp", "siamapn", "siamapnpp"} <= set(names)
    assert not {"mosse", "pysot_form", "ldenhancer"} & set(names)


def test_a_line_shows_ratios_the_way_the_header_says():
    assert LINE.row() == "| `siamrpnpp` | 287x287 | 1 | 200 | 50.0 | 4.00 |"
    assert LINE.row().count("|") == tracker_speed.HEADER.splitlines()[1].count("|")


def test_what_could_not_be_measured_is_a_dash():
    dead = replace(LINE, peer_ms=math.nan, ours_ms=math.nan)
    assert dead.row() == "| `siamrpnpp` | 287x287 | 1 | - | - | - |"


@pytest.mark.slow
def test_both_sides_are_measured_in_a_fresh_process():
    (measured,) = tracker_speed.measure(["siamrpnpp"], [1], repeats=1)
    assert (measured.tracker, measured.side, measured.threads) == ("siamrpnpp", 287, 1)
    assert 0 < measured.peer_ms < 60_000
    assert 0 < measured.ours_ms < 60_000


def test_the_size_is_known_where_the_process_took_too_long():
    (measured,) = tracker_speed.measure(["siamrpnpp"], [1], limit=0.01)
    assert measured.row() == "| `siamrpnpp` | 287x287 | 1 | - | - | - |"


def test_the_page_has_a_place_for_the_table():
    page = Path(__file__).parents[2] / "docs" / "speed.md"
    assert [page.read_text(encoding="utf-8").count(marker) for marker in MARKERS] == [1, 1]
