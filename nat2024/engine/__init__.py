"""Running trackers and enhancers over sequences; scoring reads the files that this writes."""

from nat2024.engine.benchmark import BenchmarkReport, Failure, run_benchmark
from nat2024.engine.merging import MergeReport, merge_results
from nat2024.engine.methods import name_failures, track_frame
from nat2024.engine.one_pass import track_sequence
from nat2024.engine.plan import Combination, PluginSpec, combine
from nat2024.engine.planning import shard

__all__ = [
    "BenchmarkReport",
    "Combination",
    "Failure",
    "MergeReport",
    "PluginSpec",
    "combine",
    "merge_results",
    "name_failures",
    "run_benchmark",
    "shard",
    "track_frame",
    "track_sequence",
]
