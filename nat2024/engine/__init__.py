"""Running trackers and enhancers over sequences; scoring reads the files that this writes."""

from nat2024.engine.benchmark import BenchmarkReport, Failure, run_benchmark
from nat2024.engine.one_pass import name_failures, track_frame, track_sequence
from nat2024.engine.plan import Combination, PluginSpec, combine

__all__ = [
    "BenchmarkReport",
    "Combination",
    "Failure",
    "PluginSpec",
    "combine",
    "name_failures",
    "run_benchmark",
    "track_frame",
    "track_sequence",
]
