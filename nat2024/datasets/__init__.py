"""Datasets: registered ones and any folder, their published facts, and checks against these.

>>> from nat2024.datasets import list_datasets, registered_dataset
>>> list_datasets("uavdark*")
['uavdark135', 'uavdark70']
>>> registered_dataset("uavdark135").sequences["bike1"].frames
269
"""

from nat2024.datasets.attribute_files import (
    ATTRIBUTE_COLUMNS,
    attribute_columns,
    with_attribute_files,
)
from nat2024.datasets.conversion import FORMATS, Conversion, convert
from nat2024.datasets.frames import FolderFrames, StoredFrames, read_reduced
from nat2024.datasets.index import index_dataset, write_index
from nat2024.datasets.information import DatasetInfo, SequenceInfo, describe, describe_sequence
from nat2024.datasets.labels import read_label_table, with_labels
from nat2024.datasets.loading import Rule, load_again, load_dataset
from nat2024.datasets.prefetch import Prefetch, prefetch
from nat2024.datasets.recognition import Candidate, Recognition, recognise
from nat2024.datasets.registered import (
    DatasetFacts,
    SequenceFacts,
    is_registered,
    list_datasets,
    register_dataset,
    registered_dataset,
)
from nat2024.datasets.roots import (
    Configuration,
    ConfiguredRoot,
    configuration_path,
    configured_roots,
    find_root,
    how_to_get,
    read_configuration,
    root_variable,
)
from nat2024.datasets.schema import (
    AnnotatedDataset,
    AnnotatedSequence,
    AttributeTerm,
    FrameFiles,
    decode_dataset,
    encode_dataset,
    json_schema,
)
from nat2024.datasets.schema_checks import read_dataset
from nat2024.datasets.validation import Finding, ValidationReport, validate
from nat2024.datasets.video import VideoFrames
from nat2024.datasets.writing import write_sequence

__all__ = [
    "ATTRIBUTE_COLUMNS",
    "FORMATS",
    "AnnotatedDataset",
    "AnnotatedSequence",
    "AttributeTerm",
    "Candidate",
    "Configuration",
    "ConfiguredRoot",
    "Conversion",
    "DatasetFacts",
    "DatasetInfo",
    "Finding",
    "FolderFrames",
    "FrameFiles",
    "Prefetch",
    "Recognition",
    "Rule",
    "SequenceFacts",
    "SequenceInfo",
    "StoredFrames",
    "ValidationReport",
    "VideoFrames",
    "attribute_columns",
    "configuration_path",
    "configured_roots",
    "convert",
    "decode_dataset",
    "describe",
    "describe_sequence",
    "encode_dataset",
    "find_root",
    "how_to_get",
    "index_dataset",
    "is_registered",
    "json_schema",
    "list_datasets",
    "load_again",
    "load_dataset",
    "prefetch",
    "read_configuration",
    "read_dataset",
    "read_label_table",
    "read_reduced",
    "recognise",
    "register_dataset",
    "registered_dataset",
    "root_variable",
    "validate",
    "with_attribute_files",
    "with_labels",
    "write_index",
    "write_sequence",
]
