"""`nat-bench profile`."""

import json

import pytest

from nat2024 import profiling
from nat2024.profiling import Profile


@pytest.fixture
def measured(monkeypatch):
    """What was asked for, instead of measuring it."""
    asked = {}

    def fake(combinations, sequence, **how):
        asked.update(how, combinations=combinations, sequence=sequence.name)
        rate = 123.4 if how["frames"] >= 30 else None
        numbers = (1234567, 2_500_000_000, 500_000_000, 9.0, 2.0, 3.0, rate, 800.0, 120.0)
        size = (480, 270)
        return [Profile(c.run, "cpu", 1, size, how["frames"], *numbers) for c in combinations]

    monkeypatch.setattr(profiling, "profile", fake)
    return asked


def test_the_table(cli, measured):
    status, out, _ = cli("profile", "--tracker", "mil", "--enhancer", "gamma", "--frames", 40)
    assert status == 0
    for word in ("mil+gamma", "1,234,567", "2.500", "0.500", "123.4", "120", "40 frames"):
        assert word in out
    assert measured["sequence"]
    assert [c.run for c in measured["combinations"]] == ["mil+gamma"]


def test_markdown_and_json(cli, measured):
    status, out, _ = cli("profile", "--tracker", "mil", "--markdown")
    assert status == 0
    assert "| mil | 1,234,567 | 2.500 |" in out
    status, out, _ = cli("profile", "--tracker", "mil", "--json")
    [one] = json.loads(out)["profiles"]
    assert one["macs"] == 2_500_000_000


def test_few_frames_print_no_throughput(cli, measured):
    status, out, err = cli("profile", "--tracker", "mil", "--frames", 29)
    assert status == 0
    assert "29 frames are too few, 30 tell" in err
    assert "123.4" not in out


def test_fresh_weights_reach_networks_that_are_given_none(cli, measured, tmp_path):
    words = ["--tracker", "siamrpnpp", "--enhancer", "ldenhancer", "--fresh-weights"]
    cli("profile", *words, "--weights", "ldenhancer=mine.pth", "--size", "64x36")
    [combination] = measured["combinations"]
    assert combination.tracker.weights is False
    assert combination.enhancer.weights == "mine.pth"
    assert measured["size"] == (64, 36)


@pytest.mark.parametrize("size", ["64", "0x10", "ax b", "64x", "-1x5"])
def test_a_bad_size_is_one_line(cli, measured, size):
    status, _, err = cli("profile", "--tracker", "mil", f"--size={size}")
    assert status == 2
    assert "expected WxH" in err
