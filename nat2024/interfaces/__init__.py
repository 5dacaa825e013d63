"""What an enhancer and a tracker are; base classes that leave an author one method each.

An enhancer sees no tracker, and a tracker sees at most a thing with `enhance_batch`: N + M
adapters make N x M combinations.
"""

from nat2024.interfaces.enhancers import BatchEnhancer, Enhancer, enhance_frame, run_enhancer
from nat2024.interfaces.loading import load_weights
from nat2024.interfaces.neural import NeuralEnhancer
from nat2024.interfaces.trackers import Scope, Tracker, check_start_box

__all__ = [
    "BatchEnhancer",
    "Enhancer",
    "NeuralEnhancer",
    "Scope",
    "Tracker",
    "check_start_box",
    "enhance_frame",
    "load_weights",
    "run_enhancer",
]
