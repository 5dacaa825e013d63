"""Parts of an enhancer: the reference paper's Table V, digit by digit, and several seeds."""

from typing import Any

import pytest

from nat2024_reports.layouts import Ablation, ablation_table

NAMES = ("+Baseline", "+Baseline+TB", "+Baseline+TB+LS", "+Baseline+TB+LS+TF")
LABELS = ("baseline", "TB", "TB_LS", "TB_LS_TF")
SCORES = ((0.395, 0.510), (0.408, 0.529), (0.421, 0.541), (0.434, 0.560))
RUNS = [f"siamrpnpp+ldenhancer@{label}" for label in LABELS]
PLAIN = ("siamrpnpp", "siamrpnpp", "none", "patch", 0.372, 0.474)


def rows(suffix: str = "", shift: float = 0.0) -> list[tuple[Any, ...]]:
    return [
        (run + suffix, "siamrpnpp", f"ldenhancer@{label}{suffix}", "patch", s + shift, p + shift)
        for run, label, (s, p) in zip(RUNS, LABELS, SCORES, strict=True)
    ]


def ablation(*suffixes: str) -> Ablation:
    variants = {run + end: name for end in suffixes for run, name in zip(RUNS, NAMES, strict=True)}
    return Ablation("LDEnhancer", NAMES, variants)


def test_table_v_digit_by_digit(summary: Any) -> None:
    other = ("siamrpnpp+sct", "siamrpnpp", "sct", "patch", 0.9, 0.9)
    given = summary([*reversed(rows()), other, PLAIN])
    page = ablation_table(given, ablation(""), names={"siamrpnpp": "SiamRPN++"}).for_page()
    assert page.headings == ("Tracker", "Succ.", "Δₛ (%)", "Prec.", "Δₚ (%)")
    assert [tuple(cell.text for cell in row) for row in page.rows] == [
        ("SiamRPN++", "0.372", "-", "0.474", "-"),
        ("+Baseline", "0.395", "+6.183", "0.510", "+7.595"),
        ("+Baseline+TB", "0.408", "+9.677", "0.529", "+11.603"),
        ("+Baseline+TB+LS", "0.421", "+13.172", "0.541", "+14.135"),
        ("+Baseline+TB+LS+TF (LDEnhancer)", "0.434", "+16.667", "0.560", "+18.143"),
    ]
    assert [row[1].rank for row in page.rows] == [0, 0, 0, 2, 1]
    assert not page.footnotes


def test_seeds_give_mean_and_spread(summary: Any) -> None:
    given = summary([PLAIN, *rows("-0"), *rows("-1", 0.01)])
    table = ablation_table(given, ablation("-0", "-1"))
    page = table.for_page()
    assert page.headings[:4] == ("Tracker", "Seeds", "Succ.", "Δₛ (%)")
    first, second = list(page.rows)[:2]
    assert [cell.text for cell in first][:4] == ["siamrpnpp", "1", "0.372", "-"]
    # .395 and .405: mean .4, sample deviation .01 / sqrt(2)
    assert [cell.text for cell in second][1:4] == ["2", "0.400 ±0.007", "+7.527 ±1.901"]
    file = table.for_file()
    names = [column.name or column.heading for column in file.columns]
    cells = dict(zip(names, list(file.rows)[1], strict=True))
    assert cells["Succ. deviation"].value == pytest.approx(0.01 / 2**0.5)
    assert "± sample standard deviation over seeds: a smaller gain is none" in table.footnotes


def test_a_mean_is_certain_where_every_seed_is(summary: Any, gains: Any) -> None:
    given = summary([PLAIN, *rows("-0")[:2], *rows("-1", 0.01)[:2]])
    runs = [f"{run}-{seed}" for run in RUNS[:2] for seed in (0, 1)]
    certain = [True, True, True, False]
    found = gains([(run, 9.0, 1.0, 12.0, sure) for run, sure in zip(runs, certain, strict=True)])
    table = ablation_table(given, ablation("-0", "-1"), found, intervals=True)
    page = table.for_page()
    assert [row[3].is_doubtful for row in page.rows] == [False, False, True]
    assert page.headings[3:6] == ("Δₛ (%)", "95% interval", "better %")
    assert len({len(row) for row in page.rows}) == 1


def test_missing_variants_and_tracker_are_said(summary: Any) -> None:
    table = ablation_table(summary(rows()[1:3]), ablation(""))
    assert [row[0].text for row in table.rows] == ["+Baseline+TB", "+Baseline+TB+LS"]
    assert table.footnotes == (
        "no gains of siamrpnpp: not run without an enhancer",
        "no run of +Baseline, +Baseline+TB+LS+TF",
    )
    assert ablation("").is_told_by(RUNS[:1])
    assert not ablation("").is_told_by(RUNS[3:])


def test_a_variant_without_score_is_a_dash(summary: Any) -> None:
    given = summary([PLAIN, *rows()])
    given.loc[given.run == RUNS[1], "success_auc"] = float("nan")
    row = list(ablation_table(given, ablation("")).for_page().rows)[2]
    assert [cell.text for cell in row] == ["+Baseline+TB", "-", "", "0.529", "+11.603"]
