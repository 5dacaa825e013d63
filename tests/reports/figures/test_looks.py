from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024_reports.figures.looks import DASHED, NamedRun, looks_of, views_of
from nat2024_reports.style import BLACK, COLOURS, shortened

# Machado, Oliveira and Fernandes, 2009: linear RGB as people without one kind of cone see it
_SIGHT = {
    "normal": np.eye(3),
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanope": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
_TO_XYZ = [
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
]


def lab(color: str, sight: str) -> np.ndarray:
    """CIE L*a*b* of a colour, as somebody sees it."""
    encoded = np.array([int(color[place : place + 2], 16) / 255 for place in (1, 3, 5)])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(_SIGHT[sight]) @ linear, 0, 1)
    ratio = np.asarray(_TO_XYZ) @ seen / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("sight", _SIGHT)
def test_colours_differ_for_everybody_and_stand_out_from_white(sight: str) -> None:
    seen = [lab(color, sight) for color in (*COLOURS, BLACK)]
    assert len(seen) >= 9
    assert min(np.linalg.norm(one - other) for one, other in combinations(seen, 2)) > 15
    assert max(one[0] for one in seen) < 80


def runs(trackers: str, enhancers: str) -> list[NamedRun]:
    return [
        NamedRun(t if e == "none" else f"{t}+{e}", t.upper(), e if e == "none" else e.upper())
        for t in trackers.split()
        for e in enhancers.split()
    ]


def test_one_enhancer_gives_the_papers_figure() -> None:
    (view,) = views_of(runs("a b", "none x"))
    assert view.name == ""
    assert view.is_by_tracker
    looks = view.looks
    assert looks["a"].color == looks["a+x"].color == COLOURS[0]
    assert looks["b"].color == looks["b+x"].color == COLOURS[1]
    assert [looks[run].line for run in ("a", "a+x")] == [DASHED, "-"]
    assert looks["a+x"].label == "A + X"
    assert looks["a"].label == "A"


def test_trackers_alone_are_solid_where_nothing_is_compared() -> None:
    (view,) = views_of(runs("a b", "none"))
    assert {look.line for look in view.looks.values()} == {"-"}


def test_one_tracker_with_many_enhancers_has_a_colour_each_and_is_black_alone() -> None:
    (view,) = views_of(runs("a", "none x y"))
    assert not view.is_by_tracker
    assert view.looks["a"].color == BLACK
    assert view.looks["a"].is_dashed
    assert [view.looks[run].color for run in ("a+x", "a+y")] == list(COLOURS[:2])


def test_many_of_both_are_split_into_views() -> None:
    some = [run for run in runs("a b", "none x y") if run.run != "b+y"]
    views = {view.name: list(view.looks) for view in views_of(some)}
    assert views == {
        "with_X": ["a", "a+x", "b", "b+x"],
        "with_Y": ["a", "a+y"],
        "A": ["a", "a+x", "a+y"],
        "B": ["b", "b+x"],
    }
    assert [view.name for view in views_of(some, trackers=False)] == ["with_X", "with_Y"]


def test_colours_do_not_depend_on_what_is_kept() -> None:
    every = runs("a b c", "none x")
    (whole,) = views_of(every)
    (part,) = views_of(every, keep=["c", "c+x"])
    assert part.looks["c+x"].color == whole.looks["c+x"].color == COLOURS[2]


def test_more_trackers_than_colours_are_told_by_markers() -> None:
    (view,) = views_of(runs(" ".join(f"t{n}" for n in range(19)), "none"))
    told = {(look.color, look.marker) for look in view.looks.values()}
    assert len(told) == 19
    assert view.looks["t7"].marker == ""
    assert view.looks["t8"].marker != view.looks["t16"].marker != ""


def test_nothing_gives_no_view() -> None:
    assert views_of([]) == []
    assert views_of(runs("a", "none"), keep=[]) == []


def test_labels_are_plain_and_short() -> None:
    strange = NamedRun("r", "$x^2$<script>", "e" * 90, note="3/4 seq.")
    label = looks_of([strange], [strange], by_tracker=True)["r"].label
    assert label.startswith(r"\$x^2\$<script> + eee")
    assert label.endswith("e (3/4 seq.)")
    assert len(label) < 60


def test_labels_that_matplotlib_would_hide_are_seen() -> None:
    hidden = NamedRun("_old", "_old")
    assert looks_of([hidden], [hidden], by_tracker=True)["_old"].label == " _old"


@given(st.text(max_size=80), st.integers(3, 60))
def test_shortened_names_keep_both_ends(name: str, length: int) -> None:
    short = shortened(name, length)
    assert len(short) <= length
    if len(name) <= length:
        assert short == name
    else:
        kept = (length - 1) // 2
        assert name.endswith(short[length - kept :])
        assert name.startswith(short[: length - 1 - kept])
        assert short[length - 1 - kept] == "…"
