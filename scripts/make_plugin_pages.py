"""Write the documentation pages that list plugins anew, from their cards.

    python scripts/make_plugin_pages.py

writes `docs/enhancers.md` and `docs/trackers.md`. The pages hold the plugins that come with
nat-bench; a test compares them with the cards.
"""

import importlib.metadata
from pathlib import Path

from nat2024.cards import Card, describe_card, short_count
from nat2024.registry import Kind, load_plugin

ROOT = Path(__file__).resolve().parents[1]
COMMAND = "python scripts/make_plugin_pages.py"

_INTRODUCTIONS: dict[Kind, str] = {
    "enhancer": """\
# Enhancers

What comes with nat-bench, with the facts that every plugin states in its card. `nat-bench list
--enhancers` shows them with the weights at hand, `nat-bench list NAME --card` one of them, and
`nat-bench list --json` all of it for programs.

Multiply-accumulates (MACs) are those of convolutions, linear layers and attention products for one
256x256 image; elementwise work is not counted. Official weights stay with
their authors: nat-bench neither ships nor downloads them, and [registers the file that you
have](weights.md). Files that come with the package are [of this project's own
training](bundled-weights.md).

```sh
nat-bench list --enhancers
```
""",
    "tracker": """\
# Trackers

What comes with nat-bench, with the facts that every plugin states in its card. `nat-bench list
--trackers` shows them with the weights at hand, `nat-bench list NAME --card` one of them, and
`nat-bench list --json` all of it for programs.

Multiply-accumulates (MACs) are those of convolutions, linear layers and attention products for one
search crop, as the authors' code computes them in every frame; elementwise work is not counted.
Official weights stay with their authors: nat-bench neither ships nor downloads them, and [registers
the file that you have](weights.md).

```sh
nat-bench list --trackers
```
""",
}
PAGES: dict[Kind, Path] = {
    "enhancer": ROOT / "docs" / "enhancers.md",
    "tracker": ROOT / "docs" / "trackers.md",
}


def main() -> None:
    """Write all pages."""
    for kind, path in PAGES.items():
        path.write_text(page_of(kind), encoding="utf-8")


def page_of(kind: Kind) -> str:
    """The whole page of a kind."""
    cards = {name: load_plugin(name, kind).card for name in own_plugins(kind)}
    generated = f"<!-- generated from the cards by `{COMMAND}`; do not edit by hand -->\n"
    table = "\n".join(_table(cards)) + "\n"
    sections = [_section(name, card) for name, card in sorted(cards.items())]
    return "\n".join([generated, _INTRODUCTIONS[kind], table, *sections])


def own_plugins(kind: Kind) -> list[str]:
    """Names of the plugins that come with nat-bench, those of other packages left out."""
    points = importlib.metadata.entry_points(group=f"nat_bench.{kind}s")
    return sorted({p.name for p in points if p.value.startswith(f"nat2024_{kind}s.")})


def _table(cards: dict[str, Card]) -> list[str]:
    lines = [
        "| name | title | parameters | MACs | licence of the code | licence of the weights |",
        "| --- | --- | ---: | ---: | --- | --- |",
    ]
    for name, card in sorted(cards.items()):
        licences = ", ".join(dict.fromkeys(file.licence for file in card.weights))
        counts = f"{card.parameters:,}" if card.parameters else ""
        link = f"[`{name}`](#{name})"
        cells = [link, card.title, counts, short_count(card.macs), card.code_licence, licences]
        lines.append(f"| {' | '.join(_plain(cell) for cell in cells)} |")
    return lines


def _section(name: str, card: Card) -> str:
    lines = [f"## {name}", "", f"**{_plain(card.title)}.** {_plain(card.summary)}", ""]
    for heading, facts in describe_card(card).items():
        if len(facts) == 1:
            lines.append(f"- {heading}: {_plain(facts[0])}")
        else:
            lines.append(f"- {heading}:")
            lines += [f"  - {_plain(fact)}" for fact in facts]
    return "\n".join(lines).rstrip("\n") + "\n"


def _plain(text: str) -> str:
    """Text that Markdown shows as it is, on one line."""
    line = " ".join(text.split())
    for sign in ("\\", "*", "<", "|"):  # an underscore inside a word is one
        line = line if line.startswith("[`") else line.replace(sign, f"\\{sign}")
    return line


if __name__ == "__main__":
    main()
