import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nat2024.analysis import (
    RULES,
    attribute_meanings,
    computed_attributes,
    get_rules,
    label_agreement,
    with_computed_attributes,
)
from nat2024.boxes import read_boxes
from nat2024.datasets import load_dataset
from nat2024.errors import InvalidOption, UsageError
from nat2024.types import Dataset, Sequence

NAN = [np.nan] * 4
UAV123 = ("SV", "ARC", "LR", "FM", "FOC", "POC", "OV", "BC", "IV", "VC", "CM", "SOB")


def labels(sequence: Sequence, rules: str = "uav123", **options: str) -> frozenset[str]:
    chosen = get_rules(rules, options)
    return computed_attributes(sequence, rules=chosen, pixels=False).attributes


@pytest.mark.shared
@pytest.mark.parametrize(
    ("attribute", "carriers"), {"FM": 28, "LR": 48, "SV": 109, "ARC": 68, "FOC": 33}.items()
)
def test_all_published_labels_of_uav123_are_reproduced(
    uav123: dict[str, tuple[frozenset[str], frozenset[str]]], attribute: str, carriers: int
) -> None:
    published = {name for name, (labels, _) in uav123.items() if attribute in labels}
    computed = {name for name, (_, labels) in uav123.items() if attribute in labels}
    assert len(uav123) == 123
    assert len(published) == carriers
    assert computed == published


@pytest.fixture(scope="module")
def uav123(
    shared: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[frozenset[str], frozenset[str]]]:
    """Published and computed attributes of the 123 sequences."""
    folder = tmp_path_factory.mktemp("uav123")
    found = {}
    with zipfile.ZipFile(shared / "parity" / "metrics" / "uav123.zip") as archive:
        for name in archive.namelist():
            if not name.startswith("anno/") or not name.endswith(".txt"):
                continue
            archive.extract(name, folder)
            boxes = read_boxes(folder / name)
            flags = np.loadtxt(io.StringIO(archive.read(f"att{name[4:]}").decode()), delimiter=",")
            published = frozenset(a for a, f in zip(UAV123, flags, strict=True) if f)
            sequence = Sequence(name[5:-4], range(len(boxes)), boxes)  # type: ignore[arg-type]
            found[sequence.name] = published, labels(sequence)
    return found


@pytest.mark.parametrize(
    ("boxes", "expected"),
    [
        ([[0, 0, 20, 20], [20, 0, 20, 20]], set()),  # a step of exactly 20 is none
        ([[0, 0, 20, 20], [21, 0, 20, 20]], {"FM"}),
        ([[0, 0, 20, 20], [12, 17, 20, 20]], {"FM"}),
        ([[0, 0, 20, 20], NAN, [50, 0, 20, 20]], {"FOC"}),  # no step over an absent frame
        ([[0, 0, 20, 20], [0, 0, 0, 20], [50, 0, 20, 20]], set()),  # nor over one without area
        ([[0, 0, 20, 20], [0, 0, 20, 19.9]], {"LR"}),
        ([[0, 0, 20, 40], [0, 0, 40, 40]], set()),  # a factor of exactly 2 is none
        ([[0, 0, 20, 40], [0, -20, 20, 80.4]], {"SV", "ARC"}),
        ([[0, 0, 28, 28], [0, 0, 20, 19.5]], {"SV", "LR"}),
        ([[0, 0, 30, 30], [0, 0, 43, 20.5]], {"ARC"}),
        ([NAN, [0, 0, 30, 30], [0, 0, 61, 30]], {"SV", "ARC", "FOC"}),  # against the first valid
        ([NAN, NAN], {"FOC"}),
    ],
)
def test_rules_of_uav123(make: Any, boxes: Any, expected: set[str]) -> None:
    found = labels(make(boxes))
    assert {name for name in found if not name.startswith("area")} == expected


def test_flags_of_frames(make: Any) -> None:
    sequence = make([[0, 0, 30, 30], [40, 0, 10, 10], NAN, [40, 0, 10, 10]])
    found = computed_attributes(sequence, pixels=False)
    flags = {name: np.flatnonzero(f).tolist() for name, f in found.frames.items()}
    assert flags == {
        "FM": [1],
        "LR": [1, 3],
        "SV": [1, 3],
        "ARC": [],
        "FOC": [2],
        "area<400": [1, 3],
        "area400-1000": [0],
        "area>1000": [],
    }
    assert found.measured["largest_step"] == pytest.approx(np.hypot(30, 10))
    assert found.measured["smallest_area"] == 100
    assert found.measured["scale_change"] == 9


@pytest.mark.parametrize(
    ("side", "expected"),
    [(19, "area<400"), (20, "area400-1000"), (31, "area400-1000"), (32, "area>1000")],
)
def test_size_bins_take_the_first_box(make: Any, side: int, expected: str) -> None:
    found = labels(make([NAN, [0, 0, side, side], [0, 0, 100, 100]]))
    assert {name for name in found if name.startswith("area")} == {expected}


def test_other_rules(make: Any) -> None:
    boxes = [[0, 0, 15, 15], [16, 0, 15, 15]]
    assert "FM" not in labels(make(boxes))
    assert {"FM", "LR"} <= labels(make(boxes), "lasot")
    assert "LR" not in labels(make(boxes), "uavdark135")
    assert "LR" in labels(make(boxes), "uavdark135", low_area="400")
    assert "area<16" not in labels(make(boxes), small_area="16")
    assert "area16-1000" in labels(make(boxes), small_area="16")
    assert "LR" in labels(make([[0, 0, 4, 4.9]]), "uavdark135")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"low_aera": "3"}, "no option 'low_aera'; closest: low_area"),
        ({"low_area": "x"}, "low_area=x: expected a number"),
        ({"low_area": "nan"}, "expected a number"),
        ({"light_window": "2.5"}, "expected a number"),
        ({"fast_step_relative": "1"}, "expected true or false"),
        ({"name": "mine"}, "no option 'name'"),
        ({"small_area": "2000"}, "above large_area"),
    ],
)
def test_wrong_options(options: dict[str, str], message: str) -> None:
    with pytest.raises(InvalidOption, match=message):
        get_rules("uav123", options)


def test_unknown_rules_name_the_known() -> None:
    with pytest.raises(UsageError, match="closest: uav123"):
        get_rules("uav12")
    assert get_rules("lasot", {"fast_step_relative": "false"}).fast_step_relative is False


def test_every_attribute_has_its_meaning() -> None:
    for rules in RULES.values():
        assert list(attribute_meanings(rules)) == [*rules.box_attributes, *rules.pixel_attributes]
    assert "0.5 box sizes" in attribute_meanings(get_rules("lasot", {"fast_step": "0.5"}))["FM"]


def test_low_light_is_the_mean_over_frames(make: Any) -> None:
    boxes = [[10, 10, 20, 20]] * 4
    assert "LAI" in computed_attributes(make(boxes, [15, 15, 15, 34])).attributes
    found = computed_attributes(make(boxes, [15, 15, 15, 36]))
    assert "LAI" not in found.attributes
    assert found.frames["LAI"].tolist() == [True, True, True, False]
    assert found.measured["grey_around_target"] == 20.25


def test_low_light_looks_around_the_target(make: Any) -> None:
    sequence = make([[20, 20, 20, 20]], [10])
    sequence.frames.images[0][20:40, 20:40] = 58  # a lit target in the dark: a quarter of it
    assert computed_attributes(sequence).measured["grey_around_target"] == 22
    wide = get_rules("uav123", {"low_light_context": "3"})
    assert "LAI" in computed_attributes(sequence, rules=wide).attributes


@pytest.mark.parametrize(
    ("levels", "frames"),
    [
        ([40, 60, 70, 60], []),  # 80 is less than twice 50, 30 is not more than 30
        ([40, 60, 71, 60], [2]),
        ([5, 15, 20, 25], [0, 3]),  # with the floor 35 is more than twice 15
        ([5, 15, 19, 20], []),
    ],
)
def test_light_that_changes(make: Any, levels: list[int], frames: list[int]) -> None:
    found = computed_attributes(make([[10, 10, 20, 20]] * 4, levels))
    assert np.flatnonzero(found.frames["IV"]).tolist() == frames
    assert found.labels["IV"] == bool(frames)


def test_slow_change_of_light_is_none_by_the_window(make: Any) -> None:
    levels = np.linspace(60, 110, 60)
    sequence = make([[10, 10, 20, 20]] * 60, levels.astype(int))
    assert "IV" not in computed_attributes(sequence).attributes
    assert (
        "IV"
        in computed_attributes(
            sequence, rules=get_rules("uav123", {"light_window": "40"})
        ).attributes
    )


def test_uneven_light(make: Any) -> None:
    sequence = make([[10, 10, 20, 20]] * 2, [10, 10], size=256)
    for image in sequence.frames.images:
        image[:, 128:] = 160
    found = computed_attributes(sequence)
    assert found.labels["UL"]
    assert found.frames["UL"].all()
    assert found.measured["light_spread_around_target"] < 1e-9


def test_every_second_frame_is_decoded_once(make: Any) -> None:
    sequence = make([[10, 10, 20, 20]] * 5, [5, 200, 5, 200, 5])
    calls = []
    found = computed_attributes(sequence, every=2, on_frame=lambda: calls.append(1))
    assert sequence.frames.asked == len(calls) == 3
    assert found.light is not None
    assert found.light.frames.tolist() == [0, 2, 4]
    assert found.frames["LAI"].tolist() == [True, False, True, False, True]
    assert not found.labels["IV"]
    with pytest.raises(UsageError, match="every=0"):
        computed_attributes(sequence, every=0)


def test_keyframes_tell_neither_motion_nor_absence(make: Any) -> None:
    boxes = [[0, 0, 20, 20], NAN, NAN, [60, 0, 30, 30]]
    found = computed_attributes(make(boxes, keyframes=np.array([0, 3])), pixels=False)
    assert found.labels.keys().isdisjoint({"FM", "FOC"})
    assert found.attributes == {"SV", "area400-1000"}
    assert "absent_frames" not in found.measured


def test_without_boxes_there_is_uneven_light_alone(make: Any) -> None:
    assert computed_attributes(make([])).labels.keys() == {"UL"}
    assert computed_attributes(make([]), pixels=False).labels == {}


def test_published_attributes_stay_as_published(two: Dataset) -> None:
    found = with_computed_attributes(two)
    assert found.attribute_names[:2] == ("LR", "OCC")
    assert found.attribute_names.count("LR") == 1
    # the boxes of `fast` are of low resolution, but the publisher does not say so
    assert found["fast"].attributes == {"FM", "ARC", "FOC", "area<400", "IV"}
    assert set(found["fast"].provenance.values()) == {"computed"}
    assert found["car"].attributes == {"LR", "OCC", "area400-1000", "LAI"}
    assert found["car"].provenance == {"area400-1000": "computed", "LAI": "computed"}
    assert two["car"].attributes == {"LR", "OCC"}
    assert found["fast"].boxes is two["fast"].boxes


def test_agreement_with_published_labels(two: Dataset) -> None:
    computed = {s.name: computed_attributes(s, pixels=False) for s in two}
    (found,) = label_agreement(two, computed)
    assert (found.attribute, found.sequences, found.both, found.neither) == ("LR", 2, 0, 0)
    assert found.published_only == ("car",)
    assert found.computed_only == ("fast",)
    assert found.share == 0


@given(
    arrays(float, (6, 4), elements=st.floats(-1e4, 1e4) | st.just(np.nan) | st.floats(0, 1e-300)),
    st.sampled_from(sorted(RULES)),
)
def test_any_boxes_have_attributes_and_a_sequence_has_what_a_frame_has(
    boxes: np.ndarray, rules: str
) -> None:
    sequence = Sequence("any", range(6), boxes)  # type: ignore[arg-type]
    found = computed_attributes(sequence, rules=RULES[rules], pixels=False)
    assert list(found.labels) == list(RULES[rules].box_attributes)
    for name in ("FM", "LR", "SV", "ARC", "FOC"):
        assert found.labels[name] == found.frames[name].any()
    area = boxes[:, 2] * boxes[:, 3]
    valid = np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > 0).all(axis=1) & (area > 0)
    assert sum(name in found.attributes for name in RULES[rules].size_bins) == valid.any()


def test_a_rendered_clip(night_clip: Path) -> None:
    found = with_computed_attributes(load_dataset(night_clip))
    assert all(s.provenance.keys() == s.attributes for s in found)
    assert {"area<400", "LR"} <= found["narrow"].attributes
