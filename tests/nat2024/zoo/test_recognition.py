"""Whose checkpoint a file is: by digest, else by the entries that its card calls telling."""

import pytest

from nat2024.cards import Card, NetworkFacts, WeightsFile
from nat2024.zoo import recognise

DIGEST = "ab" * 32


def card(*keys, variant="", variants=(), weights=()):
    return Card(
        title="",
        summary="",
        parameters=1,
        keys=keys,
        variant=variant,
        variants=variants,
        weights=weights,
    )


CARDS = {
    "one": card("a (1,)", "b (2,)"),
    "more": card("a (1,)", "b (2,)", "c (3,)"),
    "varied": card(
        "v (1,)",
        variant="small",
        variants=(
            NetworkFacts(variant="small_otb", keys=("v (1,)",)),
            NetworkFacts(variant="large", keys=("w (1,)", "x (1,)")),
            NetworkFacts(variant="large_otb", keys=("w (1,)",)),
        ),
        weights=(WeightsFile("large.pth", "", "", sha256=DIGEST, note="variant large"),),
    ),
    "silent": card(),
    "classical": Card(title="", summary=""),
}


@pytest.mark.parametrize(
    ("entries", "name", "variant", "wanted"),
    [
        ({"a (1,)", "b (2,)"}, "varied", "", "it looks like a checkpoint of one"),
        ({"a (1,)", "b (2,)", "c (3,)"}, "one", "", "it looks like a checkpoint of more"),
        ({"a (1,)", "b (2,)"}, "one", "", ""),
        ({"a (1,)", "b (9,)"}, "varied", "", ""),
        ({"v (1,)"}, "one", "", "it looks like a checkpoint of varied (variant small)"),
        ({"v (1,)"}, "varied", "", ""),
        ({"v (1,)"}, "varied", "small_otb", ""),
        ({"v (1,)"}, "varied", "large", "it looks like one of variant small: pass variant=small"),
        ({"w (1,)"}, "varied", "large", "it looks like one of variant large_otb: pass variant="),
        ({"w (1,)", "x (1,)"}, "varied", "", "it looks like one of variant large: pass variant=l"),
        (set(), "one", "", ""),
        ({"v (1,)"}, "of a third party", "", "it looks like a checkpoint of varied (variant sm"),
    ],
)
def test_entries_tell_network_and_variant(entries, name, variant, wanted):
    said = recognise(entries, "", CARDS, name=name, variant=variant)
    assert said.startswith(wanted)
    assert bool(said) == bool(wanted)


def test_a_published_file_is_told_by_its_digest():
    said = recognise(set(), DIGEST, CARDS, name="one")
    assert said == "it is large.pth of varied"
    said = recognise(set(), DIGEST, CARDS, name="varied", variant="small")
    assert said == "it is large.pth of variant large: pass variant=large"
    assert recognise({"w (1,)", "x (1,)"}, DIGEST, CARDS, name="varied", variant="large") == ""
