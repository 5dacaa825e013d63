"""What a dataset is made of: attributes computed from boxes and pixels, and statistics.

Whatever is computed here carries the provenance `computed`: it is no published label.
"""

from nat2024.analysis.agreement import Agreement, label_agreement
from nat2024.analysis.attributes import (
    ComputedAttributes,
    computed_attributes,
    published_attributes,
    with_computed_attributes,
)
from nat2024.analysis.documents import attribute_document, attribute_rows, frame_rows
from nat2024.analysis.light import LightTrace, trace_light
from nat2024.analysis.rules import (
    RULES,
    AttributeRules,
    attribute_meanings,
    get_rules,
)
from nat2024.analysis.statistics import DatasetStatistics, dataset_statistics

__all__ = [
    "RULES",
    "Agreement",
    "AttributeRules",
    "ComputedAttributes",
    "DatasetStatistics",
    "LightTrace",
    "attribute_document",
    "attribute_meanings",
    "attribute_rows",
    "computed_attributes",
    "dataset_statistics",
    "frame_rows",
    "get_rules",
    "label_agreement",
    "published_attributes",
    "trace_light",
    "with_computed_attributes",
]
