"""What a worker of a Dask cluster does: units, whose outcomes go back to the client."""

import threading
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from nat2024.engine.backends_used import run_and_note_backends
from nat2024.engine.kept_trackers import KeptTrackers
from nat2024.engine.plan import describe, untouched_options
from nat2024.engine.reporting import Throttled
from nat2024.engine.units import Outcome, Trackers, Unit
from nat2024.engine.workers import Setting, prepare_process, stay_on
from nat2024.errors import ClusterFailed, FrameUnreadable, NatBenchError
from nat2024.store import Manifest, setting_differences
from nat2024.types import Sequence

_TELL_SECONDS = 1.0

Expected: TypeAlias = Mapping[str, Manifest]
"""Manifests by run: what workers must be able to create alike."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a worker has to say of a unit; `unfit` where it could not even begin, and why."""

    outcomes: tuple[Outcome, ...] = ()
    unfit: str = ""
    is_without_frames: bool = False


_of_thread = threading.local()
_campaigns: "weakref.WeakKeyDictionary[KeptTrackers, str]" = weakref.WeakKeyDictionary()
"""Topics by the trackers of all threads."""


def _trackers(topic: str, setting: Setting) -> KeptTrackers:
    """The trackers of this thread for one campaign; those of an earlier one are let go."""
    if getattr(_of_thread, "topic", "") != topic:
        prepare_process(setting)
        _of_thread.trackers, _of_thread.topic = KeptTrackers(), topic
        _campaigns[_of_thread.trackers] = topic
    trackers: KeptTrackers = _of_thread.trackers
    return trackers


def forget(topic: str) -> None:
    """Let go the trackers of a campaign that has ended: its workers live on, for others too."""
    for trackers, of in list(_campaigns.items()):
        if of == topic:
            trackers.clear()


def run_on_worker(unit: Unit, expected: Expected, setting: Setting, topic: str, key: str) -> Answer:
    """Run a unit on a worker, for the client to write what comes out.

    Args:
        unit: what to do.
        expected: manifests by run.
        setting: what workers share.
        topic: where frames are told; one for each run of the client.
        key: what the news of this unit are known by.
    """
    import distributed

    worker = distributed.get_worker()

    def tell(frames: int, what: str) -> None:
        news = {"key": key, "worker": worker.address, "frames": frames, "what": what}
        worker.log_event(topic, news)

    if setting.in_turn:
        unit = _in_turn(unit, worker.name)
    try:
        trackers = _trackers(topic, setting)
        trackers.make_room(unit.combinations)
        check_fit(unit, trackers, expected)
    except NatBenchError as error:
        return Answer(unfit=f"worker {worker.address}: {error}")
    fault = next(filter(None, map(first_frame_fault, unit.sequences)), "")
    if fault:
        where = "datasets must lie on every worker under the same path"
        return Answer((), f"worker {worker.address}: {fault}; {where}", is_without_frames=True)
    seconds = _TELL_SECONDS if setting.timeout is None else min(_TELL_SECONDS, setting.timeout / 4)
    progress = Throttled(tell, seconds)
    outcomes = tuple(run_and_note_backends(unit, trackers, progress))
    progress.flush()
    return Answer(outcomes)


def _in_turn(unit: Unit, worker: object) -> Unit:
    """The unit on the CUDA device whose turn it is, by the number that a worker is named with."""
    import torch

    count = torch.cuda.device_count()
    if count < 2 or not isinstance(worker, int):
        return unit
    device = f"cuda:{worker % count}"
    stay_on(device)
    return unit.on_device(device)


def check_fit(unit: Unit, trackers: Trackers, expected: Expected) -> None:
    """See that this worker has the same plugins and weights as the client.

    Raises:
        ClusterFailed: it has others, or none.
    """
    for combination in unit.combinations:
        if trackers.has(combination):
            continue
        tracker, enhancer = trackers.create(combination)
        wanted = expected[combination.run]
        ours = describe(
            combination,
            tracker,
            enhancer,
            wanted.dataset,
            wanted.threads,
            wanted.on_bad_frame,
            wanted.batch,
        )
        untouched = untouched_options(combination, tracker, enhancer)
        differences = setting_differences(wanted, ours, untouched)
        if differences:
            msg = f"{combination.run} is another one there: {'; '.join(differences)}"
            raise ClusterFailed(msg)


def first_frame_fault(sequence: Sequence) -> str:
    """Why the first frame of a sequence cannot be read; empty where it can."""
    try:
        sequence.image(0)
    except FrameUnreadable as error:
        return str(error)
    return ""
