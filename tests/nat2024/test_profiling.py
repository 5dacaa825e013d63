"""What a combination costs, counted by hand for a network that is small enough."""

from dataclasses import replace

import pytest

from nat2024 import load_dataset
from nat2024.backends import is_installed
from nat2024.engine import combine
from nat2024.engine.plan import PluginSpec
from nat2024.errors import NatBenchError, UsageError
from nat2024.profiling import _measure, _to_and_fro, profile

PLUGINS = """
import numpy as np
import torch
from nat2024 import NeuralEnhancer, Tracker, register_enhancer, register_tracker
from nat2024.cards import Card
from nat2024.images import image_to_batch


@register_tracker("toy_tracker")
class Toy(Tracker):
    card = Card(title="Toy", summary="", scopes=("patch", "frame"))

    def __init__(self, *, fail=False, **base):
        super().__init__(**base)
        self.fail = fail
        self.model = torch.nn.Conv2d(3, 2, 3, bias=False)

    def start(self, image, box):
        self.box = box
        return box

    def advance(self, image):
        if self.fail:
            raise RuntimeError("no more")
        batch = image_to_batch(image[:10, :12].copy())
        if self.enhancer is not None:
            batch = self.enhancer.enhance_batch(batch)
        with torch.no_grad():
            self.model(batch)
        return self.box, 1.0


@register_enhancer("toy_enhancer")
class Enhancer(NeuralEnhancer):
    card = Card(title="Toy", summary="")

    def build(self):
        return torch.nn.Conv2d(3, 3, 1)

    def forward(self, batch):
        return self.model(batch)
"""


@pytest.fixture
def plugins(tmp_path):
    from nat2024 import registry

    before = dict(registry._registered)
    path = tmp_path / "toys.py"
    path.write_text(PLUGINS)
    registry.load_plugin_file(str(path))
    yield (str(path),)
    registry._registered.clear()
    registry._registered.update(before)


@pytest.fixture(scope="module")
def sequence():
    return next(iter(load_dataset("night_mini")))


@pytest.mark.skipif(not is_installed("onnxruntime", "cpu"), reason="no other runtime is installed")
def test_counts_do_not_depend_on_the_backend(plugins, sequence, monkeypatch, tmp_path):
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path))
    options = {"weights": False, "options": {"backend": "onnxruntime"}}
    [one] = combine(["toy_tracker"], ["none"])
    one = replace(one, enhancer=PluginSpec("toy_enhancer", **options))
    counted = _measure(one, sequence, 1, 0, (64, 36), 1, plugins)
    assert counted.enhancer_macs == 10 * 12 * 3 * 3
    assert counted.macs == counted.enhancer_macs + 8 * 10 * 2 * 3 * 9


def test_counts_and_times(plugins, sequence):
    combinations = combine(["toy_tracker"], ["toy_enhancer"], weights={})
    combinations = [
        type(c)(c.tracker, type(c.enhancer)("toy_enhancer", weights=False)) for c in combinations
    ]
    [one] = profile(combinations, sequence, frames=30, size=(64, 36), plugins=plugins)
    assert one.run == "toy_tracker+toy_enhancer"
    assert one.frame_size == (64, 36)
    assert one.parameters == 3 * 2 * 9 + 3 * 3 + 3
    assert one.enhancer_macs == 10 * 12 * 3 * 3
    assert one.macs == one.enhancer_macs + 8 * 10 * 2 * 3 * 9
    assert one.enhance_ms > 0
    assert one.track_ms > 0
    spent = (one.enhance_ms + one.track_ms) / 1000
    assert one.frames_per_second < 1.5 / spent
    assert one.peak_memory_mb > one.added_memory_mb >= 0


def test_few_frames_tell_no_throughput(plugins, sequence):
    combinations = combine(["toy_tracker"], ["none"])
    one = _measure(combinations[0], sequence, 29, 1, (64, 36), 1, ())
    assert one.frames_per_second is None
    assert one.track_ms > 0


def test_a_failure_names_the_run(plugins, sequence):
    combinations = combine(["toy_tracker"], ["none"], options={"toy_tracker": {"fail": "true"}})
    with pytest.raises(NatBenchError, match=r"toy_tracker: .*no more"):
        profile(combinations, sequence, frames=3, plugins=plugins)


@pytest.mark.parametrize("wrong", [{"frames": 0}, {"warm_up": 0}, {"threads": 0}])
def test_numbers_below_one_are_refused(sequence, wrong):
    with pytest.raises(UsageError, match="must be 1 or more"):
        profile([], sequence, **wrong)


def test_frames_are_played_to_and_fro():
    assert _to_and_fro(4, 8) == [1, 2, 3, 2, 1, 0, 1, 2]
    assert _to_and_fro(1, 2) == [0, 0]
    assert _to_and_fro(2, 3) == [1, 0, 1]
