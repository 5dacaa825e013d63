"""nat-bench: tracking one object from a drone at night, with low-light enhancers.

The public names below are imported when first used, so that `import nat2024` costs nothing:
torch, OpenCV, pandas and matplotlib load only when something needs them.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from nat2024.boxes import read_boxes, write_boxes
    from nat2024.datasets import list_datasets, load_dataset
    from nat2024.errors import NatBenchError
    from nat2024.evaluation import Evaluation, evaluate
    from nat2024.interfaces import Enhancer, NeuralEnhancer, Tracker
    from nat2024.metrics import Protocol, SequenceScores, evaluate_boxes
    from nat2024.registry import (
        create_enhancer,
        create_tracker,
        list_enhancers,
        list_trackers,
        register_enhancer,
        register_tracker,
    )
    from nat2024.types import Dataset, Sequence

_HOMES = {
    "Dataset": "types",
    "Enhancer": "interfaces",
    "Evaluation": "evaluation",
    "NatBenchError": "errors",
    "NeuralEnhancer": "interfaces",
    "Protocol": "metrics",
    "Sequence": "types",
    "SequenceScores": "metrics",
    "Tracker": "interfaces",
    "create_enhancer": "registry",
    "create_tracker": "registry",
    "evaluate": "evaluation",
    "evaluate_boxes": "metrics",
    "list_datasets": "datasets",
    "list_enhancers": "registry",
    "list_trackers": "registry",
    "load_dataset": "datasets",
    "read_boxes": "boxes",
    "register_enhancer": "registry",
    "register_tracker": "registry",
    "write_boxes": "boxes",
}

__all__ = [
    "Dataset",
    "Enhancer",
    "Evaluation",
    "NatBenchError",
    "NeuralEnhancer",
    "Protocol",
    "Sequence",
    "SequenceScores",
    "Tracker",
    "create_enhancer",
    "create_tracker",
    "evaluate",
    "evaluate_boxes",
    "list_datasets",
    "list_enhancers",
    "list_trackers",
    "load_dataset",
    "read_boxes",
    "register_enhancer",
    "register_tracker",
    "write_boxes",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        msg = f"module 'nat2024' has no attribute {name!r}"
        raise AttributeError(msg)
    import importlib

    return getattr(importlib.import_module(f"nat2024.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
