"""Trackers, enhancers and attributes as readers know them."""

import contextlib
import re
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from nat2024.errors import NatBenchError

if TYPE_CHECKING:
    from nat2024.registry import Kind

_TITLE = re.compile(r"(?P<name>[a-z0-9_]+)(?P<label>@[A-Za-z0-9._-]+)?(?P<variant> \(.+\))?")


def display_name(title: str, kind: "Kind") -> str:
    """The title of a plugin's card, with label and variant: `SiamRPN++@mine (compact)`.

    Foreign results of trackers and enhancers that nat-bench has not get the title that papers use
    where it is known; all other names stay as they are, and so does "none".

    Args:
        title: `NAME[@LABEL][ (VARIANT)]`, as tables show it.
        kind: "tracker" or "enhancer".
    """
    from nat2024.importing import TITLES
    from nat2024.registry import list_plugins, load_plugin

    match = _TITLE.fullmatch(title)
    if match is None or title == "none":
        return title
    if match["name"] not in list_plugins(kind):
        return f"{TITLES.get(match['name'], match['name'])}{title[match.end('name') :]}"
    with contextlib.suppress(NatBenchError):
        card = load_plugin(match["name"], kind).card
        return f"{card.title}{match['label'] or ''}{match['variant'] or ''}"
    return title


def display_names(titles: Iterable[str], kind: "Kind") -> dict[str, str]:
    """`display_name` of each; where two plugins have one title, both keep their own names."""
    shown = {title: display_name(title, kind) for title in titles}
    count = Counter(shown.values())
    return {title: title if count[name] > 1 else name for title, name in shown.items()}


def category_name(category: str) -> str:
    """`traffic sign`: a kind of target without the underscores of its key."""
    return category.replace("_", " ")


def attribute_name(abbreviation: str) -> str:
    """`illumination variation (IV)`, or the abbreviation alone where it is not known."""
    from nat2024.datasets.terms import attribute_term

    title = attribute_term(abbreviation).title
    return f"{title} ({abbreviation})" if title else abbreviation
