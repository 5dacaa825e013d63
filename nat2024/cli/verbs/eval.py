"""`nat-bench eval`: scores of stored results."""

import logging
import math
from typing import TYPE_CHECKING

import click

from nat2024.cli import options as shared
from nat2024.cli.output import print_json, print_table
from nat2024.cli.scoring import Scoring, document, print_notes, score, scoring_options
from nat2024.cli.tables import print_scores

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger("nat2024")

_SHOWN = {
    "success_auc": "Success",
    "precision_20": "Precision",
    "normalized_precision_20": "Norm. prec.",
    "normalized_precision_auc": "Norm. prec. AUC",
}


@click.command()
@scoring_options
@click.option(
    "--by",
    type=click.Choice(["run", "sequence", "attribute", "category"]),
    default="run",
    show_default=True,
    help="One row for each of these.",
)
@shared.computed_attributes_option
@shared.json_option
@shared.messages
def command(
    scoring: Scoring,
    by: str,
    computed_attributes: bool,
    as_json: bool,
) -> None:
    """Score stored results.

    The dataset is the one that the results were made on, unless --dataset names another.
    """
    evaluations = score(scoring, computed_attributes=computed_attributes)
    print_notes(evaluations)
    if as_json:
        print_json(document(evaluations))
    elif by == "run":
        print_scores(evaluations)
    else:
        for evaluation in evaluations:
            frame = getattr(evaluation, f"per_{by}")()
            if frame.empty:
                log.warning("%s: no sequence tells its %s", evaluation.dataset, by)
                continue
            title = f"{evaluation.dataset}; protocol {evaluation.protocol.title}"
            _print(frame, by, title)


def _print(frame: "pd.DataFrame", by: str, title: str) -> None:
    words = [by, "provenance", "run"] if by == "attribute" else [by, "run"]
    names = [name for name in _SHOWN if frame[name].notna().any()]
    rows = [
        [*(str(row[word]) for word in words), str(row["frames"]), *(_number(row[n]) for n in names)]
        for row in frame.sort_values(words).to_dict(orient="records")
    ]
    headings = [*(word.capitalize() for word in words), "Frames", *(_SHOWN[n] for n in names)]
    print_table(headings, rows, title=title, words=len(words))


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3f}"
