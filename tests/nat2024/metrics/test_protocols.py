import dataclasses

import numpy as np
import pytest

from nat2024.errors import NatBenchError, UsageError
from nat2024.metrics import Protocol, get_protocol, list_protocols

NAMES = ["pysot", "otb", "lasot", "pytracking", "got10k-ope", "got10k-ao", "trackingnet", "strict"]


def test_all_protocols_of_the_field_are_there() -> None:
    assert list_protocols() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_each_has_a_title_and_one_line(name) -> None:
    protocol = get_protocol(name)
    assert protocol.name == protocol.title == name
    assert protocol.description
    assert "\n" not in protocol.description


@pytest.mark.parametrize("spelling", ["snot", "PySOT", " pysot "])
def test_names_are_forgiving(spelling) -> None:
    assert get_protocol(spelling) == Protocol("pysot")
    assert get_protocol("got10k_ope").name == "got10k-ope"


def test_a_protocol_is_returned_as_it_is() -> None:
    protocol = Protocol("pytracking", label="uav", exclude_invalid=True)
    assert get_protocol(protocol) is protocol
    assert protocol.title == "pytracking (label=uav, exclude_invalid=True)"


def test_unknown_names_are_answered_with_the_closest() -> None:
    with pytest.raises(UsageError, match="closest: pytracking"):
        get_protocol("pytraking")
    with pytest.raises(NatBenchError, match="known: pysot"):
        get_protocol("zzzz")
    with pytest.raises(UsageError, match="not list"):
        get_protocol(["pysot"])


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("pysot", {"label": "uav"}),
        ("strict", {"exclude_invalid": True}),
        ("otb", {"invalid_rule": "nan"}),
        ("lasot", {"frame_size": (10, 10)}),
        ("trackingnet", {"cover": np.ones(3)}),
    ],
)
def test_options_of_other_protocols_are_refused(name, options) -> None:
    with pytest.raises(UsageError, match=f"{name} has no option {next(iter(options))}"):
        Protocol(name, **options)


@pytest.mark.parametrize(
    ("name", "rule", "canonical"),
    [
        ("got10k-ope", None, "nan"),
        ("got10k-ope", "UAV123", "nan"),
        ("got10k-ope", "LaSOT", "nan"),
        ("got10k-ope", "OTB", "none"),
        ("got10k-ope", "dtb70", "none"),
        ("pytracking", None, "positive"),
        ("pytracking", "size", "size"),
    ],
)
def test_invalid_rules(name, rule, canonical) -> None:
    assert Protocol(name, invalid_rule=rule).invalid_rule == canonical


def test_wrong_values_are_refused() -> None:
    with pytest.raises(UsageError, match="known: nan, none"):
        Protocol("got10k-ope", invalid_rule="size")
    with pytest.raises(UsageError, match="width, height"):
        Protocol("got10k-ao", frame_size=(0, 5))
    with pytest.raises(UsageError, match="one value a frame"):
        Protocol("got10k-ao", cover=np.ones((2, 2)))


def test_protocols_are_values() -> None:
    protocol = Protocol("got10k-ao", frame_size=[640, 480], cover=np.array([8, 0, 1]))
    assert hash(protocol) == hash(Protocol("got10k-ao", frame_size=(640, 480), cover=(8, 0, 1)))
    assert protocol.without_sequence_data == Protocol("got10k-ao")
    with pytest.raises(dataclasses.FrozenInstanceError):
        protocol.name = "otb"


def test_frame_size_goes_only_where_it_is_used() -> None:
    assert Protocol("got10k-ao").for_sequence((640, 480)).frame_size == (640, 480)
    given = Protocol("got10k-ao", frame_size=(10, 10))
    assert given.for_sequence((640, 480)) is given
    assert Protocol("pysot").for_sequence((640, 480)) == Protocol("pysot")
