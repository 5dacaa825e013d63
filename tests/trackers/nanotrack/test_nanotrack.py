import pickle
import shutil

import numpy as np
import pytest
import torch

import nat2024
from nat2024.errors import InvalidOption, WeightsMismatch, WeightsMissing
from nat2024.weights import import_weights, verify_weights
from nat2024.zoo import sha256_of


@pytest.fixture
def kit(shared):
    return shared / "parity" / "trackers" / "nanotrack"


def create(**options):
    return nat2024.create_tracker("nanotrack", **options)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({}, WeightsMissing, "nanotrackv3.pth from .*SiamTrackers"),
        ({"variant": "v1"}, WeightsMissing, "nanotrackv1.pth from .*SiamTrackers"),
        ({"runtime": "opencv"}, WeightsMissing, "nanotrackv3/.*both in one folder"),
        ({"runtime": "opencv", "weights": False}, InvalidOption, "no fresh weights as ONNX"),
        ({"variant": "v4", "weights": False}, InvalidOption, "it has v1, v2, v3"),
        ({"runtime": "onnx", "weights": False}, InvalidOption, "runtime=onnx"),
        ({"weights": "no/such.pth"}, WeightsMissing, "no/such.pth: no such file"),
    ],
)
def test_wrong_use_is_told_in_one_line(options, error, words):
    with pytest.raises(error, match=words) as caught:
        create(**options)
    assert "\n" not in str(caught.value)


def test_the_card_has_a_file_for_each_version():
    card = nat2024.create_tracker("nanotrack", weights=False).card
    assert [file.variant for file in card.weights] == ["v3", "v2", "v1"]
    assert [network.variant for network in card.networks] == ["v3", "v1", "v2"]


def test_version_3_is_the_default_and_has_fresh_weights(clip):
    frames, box = clip
    tracker = create(weights=False)
    assert (tracker.variant, tracker.runtime, tracker.weights.origin) == ("v3", "torch", "fresh")
    np.testing.assert_array_equal(tracker.init(frames[0], box), box + [0.5, 0.5, 0, 0])
    assert np.isfinite(tracker.update(frames[1])[0]).all()


def test_loaded_weights_count_from_the_next_init(clip):
    frames, box = clip
    torch.manual_seed(0)
    tracker, other = create(weights=False), create(weights=False)
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    tracker.model.load_state_dict(other.model.state_dict())
    for one in (tracker, other):
        one.init(frames[0], box)
    np.testing.assert_array_equal(tracker.update(frames[1])[0], other.update(frames[1])[0])


@pytest.mark.parametrize("enhance_template", [True, False])
def test_crops_are_enhanced(clip, gamma, enhance_template):
    frames, box = clip
    enhancer = gamma()
    tracker = create(weights=False, enhancer=enhancer, enhance_template=enhance_template)
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    sides = [batch.shape[-1] for batch in enhancer.batches]
    assert sides == ([127, 255] if enhance_template else [255])


@pytest.mark.shared
@pytest.mark.parametrize("variant", ["v1", "v2", "v3"])
def test_official_checkpoints_load_and_are_known(kit, variant):
    path = kit / f"nanotrack{variant}.pth"
    tracker = create(weights=path, variant=variant)
    assert tracker.weights.known_as == f"nanotrack{variant}.pth"
    with pytest.raises(pickle.UnpicklingError):  # it holds numpy scalars beside its tensors
        torch.load(path, weights_only=True, map_location="cpu")


@pytest.mark.shared
@pytest.mark.parametrize(("given", "asked"), [("v1", "v3"), ("v2", "v1"), ("v3", "v2")])
def test_weights_of_another_version_name_the_right_one(kit, tmp_path, given, asked):
    path = kit / f"nanotrack{given}.pth"
    with pytest.raises(WeightsMismatch, match=f"pass variant={given}"):
        create(weights=path, variant=asked)
    renamed = tmp_path / "mine.pth"  # no published file: told by its entries
    torch.save(create(weights=path, variant=given).model.state_dict(), renamed)
    with pytest.raises(WeightsMismatch, match=f"pass variant={given}"):
        create(weights=renamed, variant=asked)


@pytest.mark.shared
def test_onnx_files_given_to_torch_name_the_option(kit, tmp_path):
    shutil.copy(kit / "nanotrackv3_head.onnx", tmp_path)
    for weights in (tmp_path, tmp_path / "nanotrackv3_head.onnx"):
        with pytest.raises(WeightsMismatch, match="run with runtime=opencv"):
            create(weights=weights)


@pytest.mark.shared
def test_opencv_finds_both_files_and_has_no_model(kit, clip, gamma, capfd):
    frames, box = clip
    enhancer = gamma()
    tracker = create(weights=kit, variant="v3", runtime="opencv", enhancer=enhancer)
    pair = [kit / f"nanotrackv3_{part}.onnx" for part in ("backbone", "head")]
    assert tracker.weights.files == tuple(pair)
    assert tracker.weights.sha256 == sha256_of(*pair)
    assert tracker.weights.known_as.count("nanotrackv3/") == 2
    assert not hasattr(tracker, "model")
    tracker.init(frames[0], box)
    tracker.update(frames[1])
    assert [batch.shape[-1] for batch in enhancer.batches] == [127, 255]
    assert capfd.readouterr().err == ""


@pytest.mark.shared
def test_a_missing_half_is_named(kit, tmp_path):
    shutil.copy(kit / "nanotrackv3_head.onnx", tmp_path)
    with pytest.raises(WeightsMissing, match=r"no \*backbone\*\.onnx of NanoTrack v3 in it"):
        create(weights=tmp_path, runtime="opencv")


@pytest.mark.shared
def test_onnx_files_of_another_version_name_the_right_one(kit, tmp_path):
    by_name, by_digest = tmp_path / "named", tmp_path / "official"
    for part in ("backbone", "head"):
        for folder, name in (
            (by_name, f"nanotrackv2_{part}.onnx"),
            (by_digest, f"nanotrack_{part}_sim.onnx"),
        ):
            folder.mkdir(exist_ok=True)
            shutil.copy(kit / f"nanotrackv2_{part}.onnx", folder / name)
    for folder in (by_name, by_digest):
        with pytest.raises(WeightsMismatch, match="of NanoTrack v2; pass variant=v2"):
            create(weights=folder, runtime="opencv")


@pytest.mark.shared
def test_onnx_files_of_unknown_digest_are_told_by_the_size_of_their_maps(kit, tmp_path):
    for part in ("backbone", "head"):
        content = (kit / f"nanotrackv2_{part}.onnx").read_bytes()
        # An empty field of a number that ONNX does not know: another digest, the same network.
        (tmp_path / f"nanotrack_{part}.onnx").write_bytes(content + b"\xfa\x3f\x00")
    with pytest.raises(WeightsMismatch, match=r"maps of shape \(2, 16, 16\), not \(2, 15, 15\)"):
        create(weights=tmp_path, runtime="opencv")


def test_broken_onnx_files_are_told_at_creation_without_noise(tmp_path, capfd):
    for part in ("backbone", "head"):
        (tmp_path / f"nanotrack_{part}_sim.onnx").write_bytes(b"no network")
    with pytest.raises(WeightsMismatch, match="that OpenCV can run") as caught:
        create(weights=tmp_path, runtime="opencv")
    assert "\n" not in str(caught.value)
    assert "WARN" not in capfd.readouterr().err


@pytest.mark.shared
def test_registered_weights_bring_their_version_and_runtime(kit, tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path))
    entry = import_weights("nanotrack", kit / "nanotrackv2.pth")
    assert entry.options == {"variant": "v2"}
    assert create().variant == "v2"
    import_weights("nanotrack", kit, {"variant": "v1", "runtime": "opencv"})
    found = create(variant="v1")
    assert (found.runtime, found.weights.origin) == ("opencv", "registered")
    assert create(variant="v2").runtime == "torch"


@pytest.mark.shared
def test_both_runtimes_of_one_version_may_be_registered(kit, tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path))
    import_weights("nanotrack", kit / "nanotrackv3.pth")
    import_weights("nanotrack", kit, {"variant": "v3", "runtime": "opencv"})
    assert create().runtime == "torch"
    assert create(runtime="opencv").runtime == "opencv"
    assert all(verdict.ok for verdict in verify_weights("nanotrack"))
