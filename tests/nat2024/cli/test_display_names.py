"""Names that readers see."""

import pytest

from nat2024.analysis import AttributeRules
from nat2024.cli.display_names import attribute_name, category_name, display_name
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


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("IV", "illumination variation (IV)"),
        ("area<400", "first box below 400 px² (area<400)"),
        ("area400-1000.5", "first box of 400 to 1000.5 px² (area400-1000.5)"),
        ("area>1e+06", "first box above 1e+06 px² (area>1e+06)"),
        ("area", "area"),
        ("area<x", "area<x"),
    ],
)
def test_attributes_have_titles(name: str, shown: str) -> None:
    assert attribute_name(name) == shown


@pytest.mark.parametrize("limits", [{}, {"small_area": 0.5, "large_area": 3.2e7}])
def test_size_bins_of_all_limits_have_titles(limits: dict[str, float]) -> None:
    assert all(attribute_name(name) != name for name in AttributeRules(**limits).size_bins)


def test_categories_are_words() -> None:
    assert category_name("traffic_sign") == "traffic sign"
