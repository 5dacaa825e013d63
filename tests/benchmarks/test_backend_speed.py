"""The benchmark of backends: what it measures, and its table."""

import math
from pathlib import Path

import backend_speed
import pytest
from backend_speed import HEADER, MARKERS, Measured

LINE = Measured(
    "siamrpnpp",
    2,
    {"peer": 100.0, "torch": 80.0, "openvino": 50.0, "bfloat16": 25.0},
    {"torch": 0.0, "openvino": 2e-6, "bfloat16": 1e-2},
    {"peer": 90.0},
    sum_ms=80.0,
)


def test_a_line_shows_ratios_the_way_the_header_says():
    assert LINE.row() == (
        "| `siamrpnpp` | 2 | 100 | 1.25 | - | 2.00 | - | 4.00 | 1.25 | 2e-06 | 1e-02 |"
    )
    assert LINE.row().count("|") == HEADER.splitlines()[1].count("|")
    assert LINE.memory() == "Memory of `siamrpnpp` in MB, 2 threads: peer 90."


def test_what_took_too_long_is_a_dash():
    measured = backend_speed.measure(
        "dcepp@32x32", 1, repeats=1, seconds=1, limit=0.01, memory=False
    )
    assert math.isnan(measured.ms["peer"])
    assert measured.row() == "| `dcepp@32x32` | 1 | - | - | - | - | - | - | - | - | - |"


@pytest.mark.slow
def test_all_installed_sides_are_measured():
    measured = backend_speed.measure("dcepp@64x64", 1, repeats=1, seconds=9, limit=99, memory=True)
    assert set(measured.ms) == {"peer", *backend_speed.installed()} == set(measured.mb)
    assert all(0 < ms < 60_000 for ms in measured.ms.values())
    assert measured.sum_ms > 0
    assert all(away < 1e-5 for side, away in measured.away.items() if side != "bfloat16")


def test_the_page_has_a_place_for_the_table():
    page = Path(__file__).parents[2] / "docs" / "backends.md"
    assert [page.read_text(encoding="utf-8").count(marker) for marker in MARKERS] == [1, 1]
