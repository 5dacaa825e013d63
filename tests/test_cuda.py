"""What runs on CUDA gives what it gives on the CPU; skipped where there is no device.

    python -m pytest -m gpu tests/test_cuda.py

Convolutions in TF32 are off here, so that differences are those of the order of sums.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

import nat2024
from nat2024.cli import run
from nat2024.engine import combine, run_benchmark
from nat2024.networks import replaying
from nat2024.networks.replaying import Replayed
from nat2024.night import Clip, render_clip
from nat2024.store import RunFolder

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device"),
]

TRACKERS: list[tuple[str, dict[str, Any]]] = [
    ("siamrpnpp", {"variant": "compact"}),
    ("siamrpnpp", {"variant": "alex"}),
    ("siamrpnpp", {"variant": "mobilev2"}),
    ("siamrpnpp", {"variant": "r50"}),
    ("siamapn", {}),
    ("siamapnpp", {}),
    ("hift", {}),
    ("lpat", {}),
    ("nanotrack", {}),
]
NETWORKS = (
    "ldenhancer",
    "dcepp",
    "darklighter",
    "highlightnet",
    "sct",
    "enlightengan",
    "llve",
    "ruas",
    "kindpp",
)
OTHERS = ("none", "gamma", "clahe", "he", "msrcr", "adtrack_tonemap", "tone_curve", "lime")


@pytest.fixture(autouse=True)
def exact() -> Iterator[None]:
    before = torch.backends.cudnn.allow_tf32, torch.backends.cuda.matmul.allow_tf32
    torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = False
    yield
    torch.backends.cudnn.allow_tf32, torch.backends.cuda.matmul.allow_tf32 = before


@pytest.fixture(scope="module")
def clip() -> tuple[list[np.ndarray], np.ndarray]:
    made = list(render_clip(Clip("c", frames=5, size=(240, 160), seed=8)))
    return [image for image, _ in made], np.stack([box for _, box in made])


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photographs")
    rng = np.random.default_rng(3)
    for number in range(4):
        coarse = rng.integers(0, 70, size=(20, 24, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{number}.png"), np.kron(coarse, np.ones((16, 16, 1), np.uint8)))
    return folder


@pytest.mark.parametrize(("name", "options"), TRACKERS)
def test_a_tracker_follows_as_on_the_cpu(name, options, clip):
    torch.manual_seed(4)
    alone, there = (
        nat2024.create_tracker(name, weights=False, device=device, **options)
        for device in ("cpu", "cuda")
    )
    there.model.load_state_dict(alone.model.state_dict())
    frames, boxes = clip
    np.testing.assert_array_equal(there.init(frames[0], boxes[0]), alone.init(frames[0], boxes[0]))
    for frame in frames[1:]:
        there.target = alone.target
        expected, score = alone.update(frame)
        found, same_score = there.update(frame)
        assert same_score == pytest.approx(score, abs=2e-3)
        if there.last_step.index == alone.last_step.index:  # of fresh weights many are alike
            np.testing.assert_allclose(found, expected, atol=0.05, rtol=1e-3)


@pytest.mark.parametrize(("name", "options"), TRACKERS)
def test_networks_give_the_same_maps(name, options):
    torch.manual_seed(4)
    alone = nat2024.create_tracker(name, weights=False, **options)
    there = nat2024.create_tracker(name, weights=False, device="cuda", **options)
    there.model.load_state_dict(alone.model.state_dict())
    size = alone.constants.instance_size
    template, search = (torch.rand(2, 3, side, side) * 120 for side in (127, size))
    with torch.no_grad():
        expected = alone.model.match(alone.model.embed(template), search)
        found = there.model.match(there.model.embed(template.cuda()), search.cuda())
    for one, other in zip(found, expected, strict=True):
        assert one.is_cuda
        error = (one.cpu() - other).norm() / other.norm()
        assert error < 1e-3


@pytest.mark.parametrize(("name", "options"), TRACKERS)
def test_several_sequences_in_one_batch(name, options, clip):
    tracker = nat2024.create_tracker(name, weights=False, device="cuda", **options)
    frames, boxes = clip
    begun = [tracker.begin(frames[at], boxes[at]) for at in (0, 2)]
    firsts, targets = zip(*begun, strict=True)
    together = tracker.update_many([frames[1], frames[3]], firsts, targets)
    for at, step in zip((0, 1), together, strict=True):
        [single] = tracker.update_many([frames[2 * at + 1]], [firsts[at]], [targets[at]])
        assert step.score == pytest.approx(single.score, abs=2e-3)
        assert np.isfinite(step.box).all()


@pytest.mark.parametrize(("name", "options"), TRACKERS)
def test_a_replayed_network_gives_the_same_maps(name, options):
    torch.manual_seed(4)
    tracker = nat2024.create_tracker(name, weights=False, device="cuda", **options)
    size = tracker.constants.instance_size
    template = torch.rand(3, 3, 127, 127, device="cuda") * 120
    with torch.inference_mode():
        features = tracker.model.embed(template)
        for _ in range(6):
            search = torch.rand(3, 3, size, size, device="cuda") * 120
            expected = tracker.model.match(features, search)
            found = tracker.network.match(features, search)
            for one, other in zip(found, expected, strict=True):
                torch.testing.assert_close(one, other, rtol=1e-5, atol=1e-5)
    replayed = tracker.network._parts["match"]
    assert [recording is not None for recording in recordings(replayed)] == [True]


def recordings(replayed):
    return list(replayed._known().recordings.values())


def test_what_is_replayed_follows_the_weights():
    layer = torch.nn.Conv2d(3, 4, 3).cuda()
    replayed = Replayed(layer, lambda x: layer(x).relu())
    batch = torch.rand(2, 3, 9, 9, device="cuda")
    with torch.no_grad():
        for _ in range(6):
            torch.testing.assert_close(replayed(batch), layer(batch).relu())
        assert len(recordings(replayed)) == 1
        first = replayed(batch)
        kept = first.clone()
        layer.weight.mul_(-2)
        for _ in range(6):
            torch.testing.assert_close(replayed(batch), layer(batch).relu())
        torch.testing.assert_close(first, kept)  # nobody's answer is overwritten by the next
    assert replayed(batch).requires_grad


def test_what_cannot_be_recorded_is_called():
    layer = torch.nn.Conv2d(3, 4, 3).cuda()
    replayed = Replayed(layer, lambda x: layer(x) * float(x.sum()))
    batch = torch.rand(2, 3, 9, 9, device="cuda")
    with torch.no_grad():
        for _ in range(6):
            torch.testing.assert_close(replayed(batch), layer(batch) * float(batch.sum()))
        assert recordings(replayed) == [None]
        assert torch.ones(3, device="cuda").sum().item() == 3  # the device still works


def test_shapes_are_recorded_apart_and_few_are_kept(monkeypatch):
    monkeypatch.setattr(replaying, "_RECORDINGS", 2)
    layer = torch.nn.Conv2d(3, 4, 3).cuda()
    replayed = Replayed(layer, layer.forward)
    with torch.inference_mode():
        for side in (9, 10, 11, 9):
            for _ in range(30):
                batch = torch.rand(2, 3, side, side, device="cuda")
                torch.testing.assert_close(replayed(batch), layer(batch))
            assert any(recordings(replayed))
    assert len(recordings(replayed)) == 2


@pytest.mark.parametrize("name", NETWORKS)
def test_an_enhancer_that_can_be_replayed_is(name):
    torch.manual_seed(6)
    enhancer = nat2024.create_enhancer(name, weights=False, device="cuda")
    if not enhancer.can_replay:
        pytest.skip(f"{name} is not replayed")
    for shape in ((3, 3, 72, 104), (1, 3, 40, 40)):
        for _ in range(6):
            batch = torch.rand(shape, device="cuda") * 0.4
            found = enhancer.enhance_batch(batch)
            with torch.no_grad():
                expected = enhancer.forward(enhancer.pad(batch)[0])
            expected = expected[..., : shape[2], : shape[3]].clamp(0, 1)
            if enhancer.pad(batch)[0].shape == batch.shape:
                torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-5)
            assert torch.isfinite(found).all()
    assert all(recordings(enhancer._replayed))


def test_lanes_are_filled_again_on_a_device(night_clip, tmp_path):
    whole = nat2024.load_dataset(night_clip)
    cut = []
    for number, length in enumerate((8, 3, 5, 2, 8, 6, 4)):
        one = whole.sequences[number % len(whole)]
        frames = one.frames.cut(length)
        cut.append(replace(one, name=f"s{number}", frames=frames, boxes=one.boxes[:length]))
    dataset = replace(whole, sequences=tuple(cut))
    combinations = combine(["siamrpnpp"], ["none", "ldenhancer"], device="cuda")
    for batch in (1, 3):
        report = run_benchmark(combinations, dataset, tmp_path / str(batch), batch=batch, threads=4)
        assert report.failures == ()
    for one in combinations:
        alone, together = (RunFolder(tmp_path / f"{b}/night_clip/{one.run}") for b in (1, 3))
        for sequence in dataset:
            found, expected = (f.boxes(sequence.name) for f in (together, alone))
            np.testing.assert_allclose(found, expected, atol=0.05)


def test_the_bundled_weights_track_as_on_the_cpu(clip):
    frames, boxes = clip
    rows = []
    for device in ("cpu", "cuda"):
        tracker = nat2024.create_tracker("siamrpnpp", enhancer="ldenhancer", device=device)
        tracker.init(frames[0], boxes[0])
        rows.append([tracker.update(frame)[0] for frame in frames[1:]])
    np.testing.assert_allclose(rows[0], rows[1], atol=0.3)


@pytest.mark.parametrize("name", NETWORKS)
def test_an_enhancer_gives_what_it_gives_on_the_cpu(name):
    torch.manual_seed(6)
    alone, there = (
        nat2024.create_enhancer(name, weights=False, device=device) for device in ("cpu", "cuda")
    )
    there.model.load_state_dict(alone.model.state_dict())
    generator = torch.Generator().manual_seed(1)
    batch = torch.rand(2, 3, 72, 104, generator=generator) * 0.4
    found = there.enhance_batch(batch.cuda())
    assert found.is_cuda
    assert found.shape == batch.shape
    torch.testing.assert_close(found.cpu(), alone.enhance_batch(batch), atol=2e-3, rtol=2e-3)
    image = (batch[0].permute(1, 2, 0).numpy() * 255).astype(np.uint8)
    difference = there.enhance(image).astype(int) - alone.enhance(image)
    assert np.abs(difference).max() <= 1


@pytest.mark.parametrize("name", OTHERS)
def test_methods_without_networks_take_batches_there(name):
    batch = torch.rand(1, 3, 40, 56, generator=torch.Generator().manual_seed(1)) * 0.4
    weights = {"weights": False} if name == "tone_curve" else {}  # the curve that changes nothing
    expected = nat2024.create_enhancer(name, **weights).enhance_batch(batch)
    found = nat2024.create_enhancer(name, device="cuda", **weights).enhance_batch(batch.cuda())
    assert found.is_cuda
    torch.testing.assert_close(found.cpu(), expected, atol=2 / 255, rtol=0)


@pytest.mark.parametrize("precision", [False, True])
def test_ldenhancer_trains_and_resumes(tmp_path, photographs, precision):
    words = ["train", "ldenhancer", "--data", str(photographs), "--out", str(tmp_path / "t")]
    words += ["--device", "cuda", "--set", "batch_size=2", "--cache", str(tmp_path / "cache")]
    words += ["--set", f"mixed_precision={str(precision).lower()}", "--set", "checkpoint_every=2"]
    assert run([*words, "--steps", "4", "--minutes", "0.001"]) in (0, 1)
    assert run([*words, "--steps", "4"]) == 0
    assert nat2024.create_enhancer("ldenhancer", weights=tmp_path / "t/ldenhancer.safetensors")


@pytest.mark.parametrize("precision", [False, True])
def test_siamrpnpp_trains(tmp_path, photographs, night_clip, precision):
    words = ["train", "siamrpnpp", "--data", str(night_clip), "--photographs", str(photographs)]
    words += ["--out", str(tmp_path / "t"), "--device", "cuda", "--steps", "3"]
    words += ["--set", f"mixed_precision={str(precision).lower()}"]
    words += ["--set", "batch_size=4", "--set", "search=143", "--set", "checked=3"]
    assert run(words) == 0
    weights = tmp_path / "t/siamrpnpp.safetensors"
    assert nat2024.create_tracker("siamrpnpp", variant="compact", weights=weights, device="cuda")


def test_the_command_line_runs_there(tmp_path, night_clip, capsys):
    words = ["run", "--tracker", "siamrpnpp", "--enhancer", "none", "--enhancer", "ldenhancer"]
    words += ["--dataset", str(night_clip), "--results", str(tmp_path), "--device", "cuda"]
    assert run(words) == 0
    assert "(compact)" in capsys.readouterr().out
    words = ["profile", "--tracker", "siamrpnpp", "--enhancer", "ldenhancer", "--frames", "4"]
    assert run([*words, "--dataset", str(night_clip), "--warm-up", "2", "--device", "cuda"]) == 0
