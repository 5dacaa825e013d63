"""KinD++ as users create it: forms of weights, sizes and options."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from nat2024.errors import ArrayContract, InvalidOption, WeightsMismatch
from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer
from nat2024.testing.enhancers import night_image
from nat2024.zoo.tensorflow import crc32c

_SPEC = importlib.util.spec_from_file_location(
    "tensorflow_files", Path(__file__).parents[2] / "data" / "tensorflow_files.py"
)
files = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(files)

FOLDERS = {
    "decom_model": "DecomNet",
    "illu_model": "I_enhance_Net",
    "restoration_model": "Denoise_Net",
}


def write_folders(folder, variables, names=FOLDERS):
    for name in names:
        part = {k: v for k, v in variables.items() if k.startswith(FOLDERS[name] + "/")}
        (folder / name).mkdir(parents=True)
        files.write_checkpoint(folder / name / "model.ckpt", part, crc=crc32c)


def assert_loaded(enhancer, state):
    loaded = enhancer.model.state_dict()
    for key, value in state.items():
        assert torch.equal(loaded[key], value), key


def test_the_authors_folders_are_read(tmp_path, variables, state):
    write_folders(tmp_path, variables)
    assert_loaded(create_enhancer("kindpp", weights=tmp_path), state)


def test_npz_and_safetensors_are_read(tmp_path, weights, state):
    assert_loaded(create_enhancer("kindpp", weights=weights), state)
    path = tmp_path / "kindpp.safetensors"
    save_file(state, path)
    assert_loaded(create_enhancer("kindpp", weights=path), state)


def test_what_is_missing_is_named(tmp_path, variables):
    write_folders(tmp_path, variables, ["decom_model", "illu_model"])
    with pytest.raises(WeightsMismatch, match=r"restoration \(restoration_model\); .* all three"):
        create_enhancer("kindpp", weights=tmp_path)
    with pytest.raises(WeightsMismatch, match=r"decomposition .* and restoration"):
        create_enhancer("kindpp", weights=tmp_path / "illu_model" / "model.ckpt.index")
    (tmp_path / "empty").mkdir()
    with pytest.raises(WeightsMismatch, match=r"holds no TensorFlow checkpoint"):
        create_enhancer("kindpp", weights=tmp_path / "empty")


def test_two_checkpoints_of_one_network_are_refused(tmp_path, variables):
    write_folders(tmp_path, variables, ["illu_model"])
    other = {k: v + 1 for k, v in variables.items() if k.startswith("I_enhance_Net/")}
    files.write_checkpoint(tmp_path / "illu_model" / "model.ckpt-2", other)
    with pytest.raises(WeightsMismatch, match=r"keep one checkpoint of each network"):
        create_enhancer("kindpp", weights=tmp_path)


def test_pickles_in_an_npz_are_refused(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, weights=np.array([{"a": 1}], dtype=object))
    with pytest.raises(WeightsMismatch, match=r"not a readable .npz file of plain arrays"):
        create_enhancer("kindpp", weights=path)
    path.write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(WeightsMismatch, match=r"not a readable .npz"):
        create_enhancer("kindpp", weights=path)


def test_sides_are_padded_and_cut_back_or_cropped(enhancer, weights):
    batch = image_to_batch(night_image(10, 13))
    padded, top, left = enhancer.pad(batch)
    assert padded.shape[-2:] == (12, 16)
    assert (top, left) == (0, 0)
    with torch.no_grad():
        expected = enhancer.model(padded)[..., :10, :13]
    assert torch.equal(enhancer.enhance_batch(batch), expected)
    cropping = create_enhancer("kindpp", weights=weights, clamp=False, size_rule="crop")
    assert cropping.enhance_batch(batch).shape[-2:] == (8, 12)
    with pytest.raises(ArrayContract, match=r"at least 4 pixels a side, not 13x3"):
        cropping.enhance_batch(batch[..., :3, :])


def test_range_is_that_of_the_whole_image_also_when_cropping(weights):
    image = np.full((6, 6, 3), 40, np.uint8)
    image[5, 5] = 240  # cut off
    cropping = create_enhancer("kindpp", weights=weights, size_rule="crop")
    assert float(cropping.pad(image_to_batch(image))[0].max()) == 0.0


@pytest.mark.parametrize("size", [(1, 1), (3, 90), (5, 4)])
def test_black_images_and_unreal_pixels_do_no_harm(enhancer, size):
    assert enhancer.enhance(np.zeros((*size, 3), np.uint8)).shape == (*size, 3)
    batch = torch.full((1, 3, *size), float("nan"))
    assert enhancer.enhance_batch(batch).shape == batch.shape


def test_adjustment_follows_its_ratio(enhancer, weights):
    batch = image_to_batch(night_image(12, 16))
    with_ratio = {
        ratio: create_enhancer("kindpp", weights=weights, adjustment=True, ratio=ratio)
        for ratio in (1.0, 5.0)
    }
    one, five = (with_ratio[ratio].enhance_batch(batch) for ratio in (1.0, 5.0))
    assert not torch.allclose(one, five)
    assert not torch.allclose(five, enhancer.enhance_batch(batch))
    maps = with_ratio[5.0].maps(batch)
    assert set(maps) == {"R", "I", "restored", "low_i", "adjusted_I"}
    assert not torch.equal(maps["adjusted_I"], with_ratio[1.0].maps(batch)["adjusted_I"])


@pytest.mark.parametrize("ratio", [0.0, -1.0, float("nan"), float("inf")])
def test_wrong_ratios_are_refused(ratio):
    with pytest.raises(InvalidOption, match=r"ratio must be a finite number above 0"):
        create_enhancer("kindpp", weights=False, ratio=ratio)


def test_loading_a_state_dict_takes_effect_at_the_next_call(weights):
    enhancer = create_enhancer("kindpp", weights=weights)
    batch = image_to_batch(night_image(8, 12))
    before = enhancer.enhance_batch(batch)
    other = create_enhancer("kindpp", weights=False)
    enhancer.model.load_state_dict(other.model.state_dict())
    assert torch.equal(enhancer.enhance_batch(batch), other.enhance_batch(batch))
    assert not torch.equal(enhancer.enhance_batch(batch), before)


def test_card_counts_the_parameters(enhancer):
    assert enhancer.card.parameters == sum(p.numel() for p in enhancer.model.parameters())
    assert {file.licence for file in enhancer.card.weights} == {"none stated"}
