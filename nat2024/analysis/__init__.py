"""What a dataset is made of, and where trackers fail on it: attributes, statistics, failures.

Whatever is computed here carries the provenance `computed`: it is no published label.
"""

from nat2024.analysis.agreement import Agreement, label_agreement
from nat2024.analysis.attributes import (
    ComputedAttributes,
    computed_attributes,
    published_attributes,
    with_computed_attributes,
)
from nat2024.analysis.correlation import RankCorrelation, rank_correlation
from nat2024.analysis.documents import attribute_document, attribute_rows, frame_rows
from nat2024.analysis.failures import (
    DRIFT_FRAMES,
    LOSS_FRAMES,
    Failure,
    find_failure,
    lost_frames,
)
from nat2024.analysis.light import LightTrace, trace_light
from nat2024.analysis.moments import Moment, choose_moments
from nat2024.analysis.rules import (
    RULES,
    AttributeRules,
    attribute_meanings,
    get_rules,
)
from nat2024.analysis.statistics import DatasetStatistics, dataset_statistics

__all__ = [
    "DRIFT_FRAMES",
    "LOSS_FRAMES",
    "RULES",
    "Agreement",
    "AttributeRules",
    "ComputedAttributes",
    "DatasetStatistics",
    "Failure",
    "LightTrace",
    "Moment",
    "RankCorrelation",
    "attribute_document",
    "attribute_meanings",
    "attribute_rows",
    "choose_moments",
    "computed_attributes",
    "dataset_statistics",
    "find_failure",
    "frame_rows",
    "get_rules",
    "label_agreement",
    "lost_frames",
    "published_attributes",
    "rank_correlation",
    "trace_light",
    "with_computed_attributes",
]
