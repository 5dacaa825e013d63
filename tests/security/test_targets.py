"""Nearly well-formed files: whatever reads files of strangers answers, or says one line."""

import contextlib
import logging
import re
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from benchmarks.fuzz.mutations import near
from benchmarks.fuzz.seeds import MUCH, greedy_videos, seeds_of, videos
from benchmarks.fuzz.targets import TARGETS
from nat2024.errors import FrameUnreadable, NatBenchError

# Each call writes files, so few examples; `python -m benchmarks.fuzz` tries as many as you like.
EXAMPLES = 8


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> Iterator[None]:
    with caplog.at_level(logging.CRITICAL, "nat2024"):
        yield


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_are_read_or_refused_in_one_line(name: str) -> None:
    for data in seeds_of(name):
        try:
            TARGETS[name](data)
        except NatBenchError as error:
            assert "\n" not in str(error)  # noqa: PT017 - most seeds raise nothing
            assert not re.search(r"[\0-\x08\x0e-\x1f]", str(error))  # noqa: PT017


@pytest.mark.parametrize("name", TARGETS)
def test_broken_files_are_read_or_refused(name: str) -> None:
    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(near(seeds_of(name)))
    def read(data: bytes) -> None:
        with contextlib.suppress(NatBenchError):
            TARGETS[name](data)

    read()


def test_videos_are_decoded_and_those_that_claim_too_much_refused() -> None:
    assert len(videos()) >= 4
    for data in videos():
        TARGETS["video"](data)
    assert greedy_videos()
    for data in greedy_videos():
        with pytest.raises(FrameUnreadable, match=f"claims {MUCH} samples in {len(data)} bytes"):
            TARGETS["video"](data)


@pytest.mark.parametrize("name", ["boxes", "manifest", "index", "safetensors", "matlab", "image"])
def test_the_first_seed_is_well_formed(name: str) -> None:
    TARGETS[name](seeds_of(name)[0])
