"""Tables of failures: evidence of stored results, gathered and laid out."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from nat2024.cli.progress import ProgressBar
from nat2024.cli.scoring import Scored

if TYPE_CHECKING:
    import pandas as pd

    from nat2024.evidence import Evidence
    from nat2024_reports.tables import Table

    Naming = Callable[[pd.DataFrame], pd.DataFrame]


def gathered(scored: Scored) -> "Evidence":
    """The evidence of scored results, with a bar for the frames that are looked at."""
    from nat2024.evidence import gather

    dataset = scored.dataset
    with ProgressBar(0) as bar:
        return gather(
            scored.evaluation, dataset, scored.folder, on_frame=lambda: bar(1, dataset.name)
        )


def failures_of(scored: Scored, named: "Naming") -> "list[Table]":
    """One row a run; `named` gives trackers and enhancers the names to show."""
    from nat2024_reports.layouts.failures import failures_table

    return [_table(scored, failures_table, named)]


def losses_of(scored: Scored, named: "Naming") -> "list[Table]":
    """One row for each run and sequence with a loss; `named` as in `failures_of`."""
    from nat2024_reports.layouts.failures import losses_table

    return [_table(scored, losses_table, named)]


def _table(scored: Scored, make: "Callable[..., Table]", named: "Naming") -> "Table":
    evidence = gathered(scored)
    return make(named(evidence.failures()), evidence.dataset, evidence.loss_frames, evidence.notes)
