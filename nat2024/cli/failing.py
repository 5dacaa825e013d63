"""Tables of failures: evidence of stored results, gathered and laid out."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from nat2024.cli.progress import ProgressBar
from nat2024.cli.scoring import Scored

if TYPE_CHECKING:
    from nat2024.evidence import Evidence
    from nat2024_reports.tables import Table


def gathered(scored: Scored) -> "Evidence":
    """The evidence of scored results, with a bar for the frames that are looked at."""
    from nat2024.evidence import gather

    dataset = scored.dataset
    with ProgressBar(0) as bar:
        return gather(
            scored.evaluation, dataset, scored.folder, on_frame=lambda: bar(1, dataset.name)
        )


def failures_of(scored: Scored) -> "list[Table]":
    """One row a run."""
    from nat2024_reports.layouts.failures import failures_table

    return [_table(scored, failures_table)]


def losses_of(scored: Scored) -> "list[Table]":
    """One row for each run and sequence with a loss."""
    from nat2024_reports.layouts.failures import losses_table

    return [_table(scored, losses_table)]


def _table(scored: Scored, make: "Callable[..., Table]") -> "Table":
    evidence = gathered(scored)
    return make(evidence.failures(), evidence.dataset, evidence.loss_frames, evidence.notes)
