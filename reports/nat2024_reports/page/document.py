"""One HTML file from the model: template, style, script and data, with no door to the outside.

The page's own policy forbids every request: only the style and the script with these digests may
act, and pictures come from inside the file. Equal input gives equal bytes.
"""

import base64
import hashlib
import json
from functools import cache
from importlib.resources import files
from typing import Any

from nat2024_reports.page.model import DatasetPart, Page
from nat2024_reports.page.payload import METRICS, page_payload, plain

SCRIPTS = (
    "elements", "numbers", "state", "selection", "highlight", "tables", "controls", "overview",
    "charts", "curves", "gains", "matrix", "failures", "scatter",
    "timeline", "pictures", "sequence", "main",
)  # fmt: skip
"""Modules of the page's script in the order in which they need each other."""

_MISSING = "\u2013"

STYLES = ("look", "parts", "print")
"""Style sheets in their order."""


def build_page(page: Page) -> str:
    """The whole file as text.

    Args:
        page: at least one dataset with at least one protocol.

    Raises:
        ValueError: there is no dataset.
    """
    if not page.datasets:
        msg = "a page needs at least one dataset"
        raise ValueError(msg)
    from jinja2 import Environment, StrictUndefined

    first, details = page_payload(page)
    style, script = _style(), _script()
    policy = (
        "default-src 'none'; "
        f"script-src '{_digest(script)}'; style-src '{_digest(style)}'; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(_read("page.html.jinja"))
    text = template.render(
        title=page.title,
        policy=policy,
        style=style,
        script=script,
        data=_embedded(first),
        details={key: _embedded(detail) for key, detail in details.items()},
        tables=[_table(dataset) for dataset in page.datasets],
        remarks=first["remarks"],
        made_by=page.made_by,
    )
    # names of files may hold what no text can: halves of surrogate pairs
    return text.encode(errors="replace").decode()


def _table(dataset: DatasetPart) -> dict[str, Any]:
    """The main table as texts, for readers without scripts."""
    protocol = dataset.protocols[0]
    summary = protocol.subsets[0].summary.set_index("run")
    names = [name for name in METRICS if name in summary and summary[name].notna().any()]
    rows = []
    for run in dataset.runs:
        if run.name not in summary.index:
            continue
        row = summary.loc[run.name]
        enhancer = _MISSING if run.enhancer == "none" else run.enhancer
        scores = [_text(plain(row[name])) for name in names]
        rows.append([run.tracker, enhancer, str(row["sequences"]), *scores])
    return {
        "name": dataset.name,
        "protocol": protocol.title,
        "headings": ["Tracker", "Enhancer", "Sequences", *(METRICS[name][0] for name in names)],
        "rows": rows,
        "remarks": dataset.remarks,
    }


def _text(value: float | None) -> str:
    return _MISSING if value is None else f"{value:.3f}"


def _embedded(value: Any) -> str:
    """JSON that no HTML parser can mistake for the end of its element."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    # no letter is left that HTML would read
    return text


@cache
def _read(name: str) -> str:
    found = files("nat2024_reports.page")
    for part in name.split("/"):
        found = found / part
    return found.read_text(encoding="utf-8")


def _style() -> str:
    return "\n" + "\n".join(_read(f"style/{name}.css") for name in STYLES)


def _script() -> str:
    modules = "\n".join(_read(f"script/{name}.js") for name in SCRIPTS)
    return f'\n"use strict";\n(() => {{\n{modules}\nstart();\n}})();\n'


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
