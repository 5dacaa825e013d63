"""Names that readers see."""

import pytest

from nat2024.cli.display_names import category_name, display_name
from nat2024.importing import split_name


@pytest.mark.parametrize(
    ("title", "kind", "shown"),
    [
        ("siamrpnpp@mine (compact)", "tracker", "SiamRPN++@mine (compact)"),
        ("ldenhancer", "enhancer", "LDEnhancer"),
        ("none", "enhancer", "none"),
        ("<b>", "tracker", "<b>"),
        ("stranger@a", "tracker", "stranger@a"),
        (split_name("prdimp50_DCE")[0], "tracker", "PrDiMP-50"),
        (split_name("prdimp50_DCE")[1], "enhancer", "Zero-DCE"),
    ],
)
def test_plugins_and_published_results_have_the_names_of_papers(
    title: str, kind: str, shown: str
) -> None:
    assert display_name(title, kind) == shown  # type: ignore[arg-type]


def test_categories_are_words() -> None:
    assert category_name("traffic_sign") == "traffic sign"
