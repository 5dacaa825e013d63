"""Every error that a user can cause, each saying what is wrong, where, and what to do next.

The command line prints the message of a `NatBenchError` as one line and leaves with status 2.
"""


class NatBenchError(Exception):
    """Base of all errors that nat-bench raises on purpose."""


class UsageError(NatBenchError):
    """A call or command whose words do not fit together."""


class UnknownPlugin(NatBenchError):
    """A tracker, enhancer or dataset name that nothing answers to."""


class BrokenPlugin(NatBenchError):
    """A plugin that is listed but cannot be imported or does not keep its contract."""


class DuplicatePlugin(NatBenchError):
    """Two plugins that claim the same name."""


class InvalidOption(NatBenchError):
    """A plugin option that does not exist or has a value of the wrong type."""


class DatasetNotFound(NatBenchError):
    """A dataset whose folder is absent or is no dataset."""


class DatasetIncomplete(NatBenchError):
    """A dataset whose files do not fit together: missing, extra or of the wrong length."""


class UnknownSequence(NatBenchError):
    """A sequence name that the dataset does not have."""


class BoxFileError(NatBenchError):
    """A text file of boxes that cannot be read; names file and line."""


class AnnotationInvalid(NatBenchError):
    """An annotation file, such as an index or COCO JSON, that cannot be read or used."""


class Unwritable(NatBenchError):
    """A file or folder that cannot be written."""


class FrameUnreadable(NatBenchError):
    """An image file that is absent, truncated or no image."""


class ArrayContract(NatBenchError):
    """An array of the wrong shape, type or range."""


class OutOfMemory(NatBenchError):
    """An image or batch for which the device has too little memory."""


class LengthMismatch(NatBenchError):
    """A result and its ground truth that differ in length."""


class WeightsMissing(NatBenchError):
    """A network for which no weights were given, registered or bundled."""


class WeightsMismatch(NatBenchError):
    """A checkpoint that does not fit the network, or that is not safe to load."""


class WrongNetwork(WeightsMismatch):
    """A checkpoint of another network.

    Attributes:
        entries: what the checkpoint holds, as `KEY SHAPE` texts; tells what it is of.
    """

    entries: frozenset[str] = frozenset()


class BackendMismatch(NatBenchError):
    """A runtime that cannot run a network, or gives other numbers than PyTorch."""


class ResultConflict(NatBenchError):
    """A results folder that was made with other options, weights or scope."""


class TrainingFailed(NatBenchError):
    """A training that cannot go on: its loss is not finite, or no loss; checkpoints are kept."""


class TimedOut(NatBenchError):
    """A sequence that took a tracker longer than it may."""


class ClusterFailed(NatBenchError):
    """A cluster that cannot be had, is gone, or whose workers cannot do the work."""
