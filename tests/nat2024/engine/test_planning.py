"""Units of work: every job once, balanced, longest first; shards likewise."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.engine import shard
from nat2024.engine.lockstep import Reading
from nat2024.engine.plan import Combination, PluginSpec
from nat2024.engine.planning import LANE_ROUNDS, STEP_FRAMES, TOGETHER, cost, plan_units
from nat2024.engine.workers import sort_out
from nat2024.errors import UsageError
from nat2024.types import Dataset, Sequence


def dataset(*lengths: int) -> Dataset:
    return Dataset(
        "clip",
        tuple(
            Sequence(f"s{number:03d}", [None] * length, np.ones((length, 4)))  # type: ignore[arg-type]
            for number, length in enumerate(lengths)
        ),
    )


def product(trackers: int, enhancers: int) -> list[Combination]:
    return [
        Combination(PluginSpec(f"t{t}"), PluginSpec(f"e{e}") if e else None)
        for t in range(trackers)
        for e in range(enhancers)
    ]


def plan(data: Dataset, runs: list[Combination], **how: Any) -> Any:
    missing = how.pop("missing", {s.name: runs for s in data})
    batches = how.pop("batches", {c.run: 1 for c in runs})
    return plan_units(missing, data, Reading(), batches=batches, **how)


@given(
    st.lists(st.integers(1, 500), min_size=1, max_size=9),
    st.integers(1, 4),
    st.integers(1, 5),
    st.integers(1, 20),
    st.integers(1, 4),
    st.randoms(use_true_random=False),
)
def test_every_missing_job_is_in_one_unit(
    lengths: list[int], trackers: int, enhancers: int, workers: int, batch: int, random: Any
) -> None:
    data, runs = dataset(*lengths), product(trackers, enhancers)
    missing = {s.name: [c for c in runs if random.random() < 0.7] for s in data}
    batches = {c.run: random.choice([1, batch]) for c in runs}
    units = plan(data, runs, missing=missing, batches=batches, workers=workers)
    jobs = Counter(job for unit in units for job in unit.jobs)
    assert jobs == Counter((c.run, name) for name, some in missing.items() for c in some)
    for unit in units:
        assert len(unit.combinations) <= TOGETHER
        assert unit.lanes <= min(batches[c.run] for c in unit.combinations)
        assert unit.lanes <= len(unit.sequences)
        assert len(unit.sequences) <= (LANE_ROUNDS * unit.lanes if unit.lanes > 1 else 1)


def test_one_process_decodes_each_sequence_once_in_order() -> None:
    units = plan(dataset(5, 90, 20), product(3, 4))
    assert [[s.name for s in unit.sequences] for unit in units] == [["s000"], ["s001"], ["s002"]]
    assert all(len(unit.combinations) == 12 for unit in units)


def test_more_combinations_than_may_go_together_are_split_evenly_by_enhancer() -> None:
    (first, second) = plan(dataset(5), product(2, 10))
    assert len(first.combinations) == len(second.combinations) == 10
    for unit in (first, second):
        names = [c.enhancer.title if c.enhancer else "" for c in unit.combinations]
        assert names == sorted(names)
        assert set(Counter(names).values()) == {2}


@pytest.mark.parametrize("workers", [2, 8, 64])
def test_the_longest_go_first_and_nobody_waits_long(workers: int) -> None:
    lengths = [3000, 2500, 700, 650, 600, 500, 300, 280, 120, 90]
    units = plan(dataset(*lengths), product(5, 11), workers=workers)
    sizes = [unit.frames for unit in units]
    assert sizes == sorted(sizes, reverse=True)
    ends = [0.0] * workers
    for size in sizes:  # each worker takes the next unit as soon as it is free
        ends[ends.index(min(ends))] += size
    ideal = max(sum(sizes) / workers, max(lengths))  # no sequence of a combination can be split
    assert max(ends) <= 1.3 * ideal


def test_one_process_fills_its_lanes_from_all_sequences_the_longest_first() -> None:
    data, runs = dataset(10, 900, 12, 880, 11, 13, 9, 8, 7), product(1, 1)
    [unit] = plan(data, runs, batches={"t0": 2}, in_process=True)
    assert [len(s) for s in unit.sequences] == [900, 880, 13, 12, 11, 10, 9, 8, 7]
    assert unit.lanes == 2
    first, second = plan(data, runs, batches={"t0": 2})  # elsewhere no unit is that large
    assert {len(first.sequences), len(second.sequences)} == {LANE_ROUNDS * 2, 1}


@given(
    st.lists(st.integers(1, 900), min_size=1, max_size=60),
    st.integers(2, 5),
    st.integers(2, 8),
    st.integers(1, 20),
)
def test_workers_end_soonest_with_what_they_are_given(
    lengths: list[int], workers: int, batch: int, trackers: int
) -> None:
    runs = product(trackers, 1)
    how: Any = {"batches": {run.run: batch for run in runs}, "workers": workers}
    units = plan(dataset(*lengths), runs, **how)

    def end(units: Any) -> float:
        free = [0.0] * workers
        for unit in units:
            free[free.index(min(free))] += cost(unit)
        return max(free)

    every = plan(dataset(*lengths), runs, **how | {"workers": 1})
    assert end(units) <= sum(map(cost, every)) + len(runs) * 2 * max(lengths)
    assert sum(unit.frames for unit in units) == len(runs) * sum(lengths)


@pytest.mark.parametrize(("trackers", "least"), [(55, 0.9), (11, 0.9), (2, 0.75)])
def test_eight_workers_have_full_lanes_to_the_end(trackers: int, least: float) -> None:
    rng = np.random.default_rng(1)
    lengths = [round(length) for length in rng.lognormal(6.5, 0.6, size=135)]
    runs = product(trackers, 1)
    units = plan(dataset(*lengths), runs, batches={run.run: 8 for run in runs}, workers=8)
    free = [0.0] * 8
    for unit in units:
        free[free.index(min(free))] += cost(unit)
    ideal = trackers * sum(lengths) * (1 + STEP_FRAMES / 8) / 8
    assert ideal / max(free) > least


def test_a_unit_whose_worker_died_is_narrowed_before_it_is_taken_apart() -> None:
    runs = product(2, 1)
    [unit] = plan(dataset(9, 8, 7, 6, 5), runs, batches={"t0": 2, "t1": 2}, in_process=True)
    assert unit.refills
    pending = set(unit.jobs) - {("t0", "s000"), ("t1", "s000"), ("t0", "s001")}
    narrow = unit.narrowed(pending)
    assert {job for one in narrow for job in one.jobs} == pending
    assert [[s.name for s in one.sequences] for one in narrow] == [
        ["s001"],
        ["s002", "s003"],
        ["s004"],
    ]
    assert not any(one.refills for one in narrow)
    singles = narrow[1].narrowed(set(narrow[1].jobs))
    assert [len(one.jobs) for one in singles] == [1] * 4
    tries: Counter[Any] = Counter()
    assert sort_out(unit, pending, tries, 0) == (narrow, [])
    assert not tries


@given(st.lists(st.integers(1, 3000), min_size=1, max_size=40), st.integers(1, 40))
def test_shards_are_disjoint_whole_and_balanced(lengths: list[int], count: int) -> None:
    data, count = dataset(*lengths), min(count, len(lengths))
    parts = [shard(data, number + 1, count) for number in range(count)]
    names = [s.name for part in parts for s in part]
    assert sorted(names) == [s.name for s in data]
    frames = [sum(map(len, part)) for part in parts]
    assert max(frames) - min(frames) <= max(lengths)
    assert all(len(part) for part in parts)


def test_shards_do_not_depend_on_the_order_of_sequences() -> None:
    data = dataset(5, 5, 7, 7, 9, 1)
    turned = Dataset("clip", data.sequences[::-1])
    for number in (1, 2, 3):
        one, other = shard(data, number, 3), shard(turned, number, 3)
        assert {s.name for s in one} == {s.name for s in other}


@pytest.mark.parametrize(("number", "count"), [(0, 3), (4, 3), (1, 0), (1, 7)])
def test_shards_that_there_are_not(number: int, count: int) -> None:
    with pytest.raises(UsageError, match=f"shard {number}/{count}"):
        shard(dataset(1, 2, 3, 4, 5, 6), number, count)
