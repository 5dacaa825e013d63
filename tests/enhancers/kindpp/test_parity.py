"""Equality with the official code: restoration with weights from a formula."""

import json

import cv2
import numpy as np
import pytest

from nat2024.images import image_to_batch
from nat2024.registry import create_enhancer

pytestmark = pytest.mark.shared
NAMES = {"adjusted_I": "adjusted_I_ratio5"}


@pytest.fixture(scope="module")
def official(kit, variables, tmp_path_factory):
    with np.load(kit / "checkpoints" / "kindpp_decom_illu_tf_layout.npz") as stored:
        arrays = {**variables, **dict(stored)}
    path = tmp_path_factory.mktemp("kindpp") / "official.npz"
    np.savez(path, **arrays)
    return path


def test_variables_are_the_official_ones(kit, variables):
    keys = json.loads((kit / "keys" / "kindpp.json").read_text())
    expected = {entry["key"]: tuple(entry["shape"]) for entry in keys}
    assert {name: array.shape for name, array in variables.items()} == expected


def test_maps_and_results_equal_the_official_ones(kit, official):
    case = "dt76_101x77"
    image = cv2.imread(str(kit / "inputs" / f"{case}.png"))[..., ::-1]
    batch = image_to_batch(image)
    options = {"weights": official, "clamp": False, "size_rule": "crop"}
    plain = create_enhancer("kindpp", **options)
    maps = plain.maps(batch)
    with np.load(kit / "outputs" / "kindpp" / f"{case}.npz") as stored:
        expected = dict(stored)
    adjusting = create_enhancer("kindpp", adjustment=True, **options)
    results = {
        "fusion_default": plain.enhance_batch(batch),
        "fusion_adjust": adjusting.enhance_batch(batch),
    }
    found = {NAMES.get(name, name): value for name, value in maps.items()} | results
    assert found.keys() >= expected.keys()
    for name, value in found.items():
        actual = value[0].numpy()
        np.testing.assert_allclose(actual, expected[name], rtol=0, atol=1e-5, err_msg=name)
