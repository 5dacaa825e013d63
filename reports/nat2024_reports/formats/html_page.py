"""Tables as one HTML page that needs nothing else; everything from outside is escaped."""

from collections.abc import Sequence
from html import escape

from nat2024_reports.tables import MARK, Cell, Column, Table

_STYLE = """
body { font: 15px/1.4 system-ui, sans-serif; margin: 2rem auto; max-width: 80rem; padding: 0 1rem;
  color: #1a1a1a; background: #fff; }
figure { margin: 0 0 2.5rem; overflow-x: auto; }
table { border-collapse: collapse; border-top: 2px solid; border-bottom: 2px solid;
  font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: .5rem; }
th, td { padding: .2rem .55rem; text-align: right; white-space: nowrap; }
thead th { white-space: normal; }
th.words, td.words { text-align: left; }
thead th { border-bottom: 1px solid; vertical-align: bottom; font-weight: 600; }
tbody + tbody tr:first-child td { border-top: 1px solid #bbb; }
tbody tr:hover { background: #8883; }
.second { text-decoration: underline; text-underline-offset: .2em; }
.doubtful { color: #6b6b6b; }
figcaption { margin-top: .5rem; color: #555; font-size: .87em; max-width: 60rem; }
@media (prefers-color-scheme: dark) {
  body { color: #e6e6e6; background: #16181b; }
  .doubtful, figcaption { color: #a6a6a6; }
  tbody + tbody tr:first-child td { border-top-color: #555; }
}
@media print { body { margin: 0; } figure { overflow: visible; } }
"""
_TAGS = ("{}", "<b>{}</b>", '<span class="second">{}</span>')


def as_html(tables: Sequence[Table]) -> str:
    """A page with all tables, captions above and footnotes below."""
    title = escape(tables[0].caption) if tables else "Tables"
    body = "\n".join(_one(table.for_page()) for table in tables)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def _one(table: Table) -> str:
    heads = "".join(
        f'<th scope="col"{_class(column)}>{escape(column.heading)}</th>' for column in table.columns
    )
    bodies = []
    for group in table.groups:
        rows = (
            "".join(_entry(column, cell) for column, cell in zip(table.columns, row, strict=True))
            for row in group
        )
        bodies.append("<tbody>\n" + "".join(f"<tr>{row}</tr>\n" for row in rows) + "</tbody>")
    notes = "<br>\n".join(map(escape, table.footnotes))
    below = f"\n<figcaption>{notes}</figcaption>" if notes else ""
    return (
        f"<figure>\n<table>\n<caption>{escape(table.caption)}</caption>\n"
        f"<thead><tr>{heads}</tr></thead>\n" + "\n".join(bodies) + f"\n</table>{below}\n</figure>"
    )


def _entry(column: Column, cell: Cell) -> str:
    text = _TAGS[cell.rank].format(escape(cell.text))
    if cell.is_doubtful:
        text = f'<span class="doubtful">{text}&#8202;{MARK}</span>'
    return f"<td{_class(column)}>{text}</td>"


def _class(column: Column) -> str:
    return ' class="words"' if column.is_words else ""
