"""The pages that list plugins say what the cards say."""

import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "make_plugin_pages.py"


@pytest.fixture(scope="module")
def pages():
    spec = importlib.util.spec_from_file_location("make_plugin_pages", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_committed_pages_are_up_to_date(pages):
    for kind, path in pages.PAGES.items():
        committed = path.read_text(encoding="utf-8") == pages.page_of(kind)
        assert committed, f"{path.name} is older than the cards; run: {pages.COMMAND}"


@pytest.mark.parametrize(
    ("kind", "some", "line"),
    [
        (
            "enhancer",
            {"ldenhancer", "none", "gamma"},
            "33,522 | 1.723 G | none stated | none stated, Apache-2.0; trained on images",
        ),
        (
            "tracker",
            {"siamapn", "mosse", "mil"},
            "15,149,005 | 10.15 G | Apache-2.0 | none stated |",
        ),
    ],
)
def test_every_own_plugin_has_its_line_and_section(pages, kind, some, line):
    text = pages.page_of(kind)
    names = pages.own_plugins(kind)
    assert some <= set(names)
    for name in names:
        assert f"\n## {name}\n" in text
        assert text.count(f"| [`{name}`](#{name}) |") == 1
    assert line in text


def test_signs_of_markdown_are_escaped(pages):
    assert pages._plain("a_b *c*\n | <d>") == r"a_b \*c\* \| \<d>"
