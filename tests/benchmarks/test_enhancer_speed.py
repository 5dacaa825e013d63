"""The benchmark of enhancers: what it measures, and its table."""

import math
from dataclasses import replace
from pathlib import Path

import enhancer_speed
import pytest
from enhancer_speed import MARKERS, Case, Measured

TINY = Case("ldenhancer", 48, 32, 1)
LINE = Measured(TINY, 200.0, 50.0, 1000.0, 250.0)


def test_only_enhancers_with_a_plain_form_are_measured():
    names = enhancer_speed.enhancers_with_peers()
    assert "ldenhancer" in names
    assert not {"clahe", "pysot_form"} & set(names)


def test_a_line_shows_ratios_the_way_the_header_says():
    assert LINE.row() == "| `ldenhancer` | 48x32 | 1 | 200 | 50.0 | 4.00 | 1,000 | 250 | 0.25 |"
    assert LINE.row().count("|") == enhancer_speed.HEADER.splitlines()[1].count("|")


def test_what_could_not_be_measured_is_a_dash():
    dead = replace(LINE, peer_ms=math.nan, peer_mb=math.nan)
    assert dead.row() == "| `ldenhancer` | 48x32 | 1 | - | 50.0 | - | - | 250 | - |"


@pytest.mark.slow
def test_both_sides_are_measured_in_fresh_processes():
    (measured,) = enhancer_speed.measure(["ldenhancer"], [(48, 32)], [1], repeats=1)
    assert measured.case == TINY
    for value in (measured.peer_ms, measured.ours_ms, measured.peer_mb, measured.ours_mb):
        assert 0 < value < 60_000


@pytest.mark.slow
def test_a_process_that_dies_leaves_no_number():
    absent = replace(TINY, enhancer="absent")
    assert math.isnan(enhancer_speed.in_own_process(absent, 60, side="ours")["ours"])
    assert math.isnan(enhancer_speed.in_own_process(TINY, 0.01, side="ours")["ours"])


def test_the_page_has_a_place_for_the_table():
    page = Path(__file__).parents[2] / "docs" / "speed.md"
    assert [page.read_text(encoding="utf-8").count(marker) for marker in MARKERS] == [1, 1]
