"""What stands in the tables of a paper: one module a layout, each from scores to a `Table`."""

from nat2024_reports.layouts.ablation import Ablation, ablation_table
from nat2024_reports.layouts.enhancers import enhancers_tables
from nat2024_reports.layouts.groups import groups_table
from nat2024_reports.layouts.overall import overall_table
from nat2024_reports.layouts.protocols import protocols_table
from nat2024_reports.layouts.scores import comparable
from nat2024_reports.layouts.sequences import sequences_table
from nat2024_reports.layouts.speed import speed_table

__all__ = [
    "Ablation",
    "ablation_table",
    "comparable",
    "enhancers_tables",
    "groups_table",
    "overall_table",
    "protocols_table",
    "sequences_table",
    "speed_table",
]
