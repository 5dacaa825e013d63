import numpy as np
import pytest

from nat2024.errors import WeightsMissing
from nat2024.evidence import make_again
from nat2024.evidence.enhancers import RunEnhancer
from nat2024.store import DatasetRecord, Manifest, PluginRecord, WeightsRecord


def manifest(scope: str, **changes: object) -> Manifest:
    gamma = PluginRecord("gamma", options={"gamma": 0.5})
    given = {"enhancer": gamma, "scope": scope, **changes}
    return Manifest(dataset=DatasetRecord("d"), tracker=PluginRecord("kcf"), **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("scope", ["patch", "frame"])
def test_over_enhancement_of_the_region_around_a_box(scope: str) -> None:
    frame = np.full((300, 400, 3), 20, np.uint8)
    frame[100:140, 100:140] = 204  # 0.8, and gamma makes 0.894 of it
    enhancer = RunEnhancer(manifest(scope))
    found = enhancer.over_enhancement(frame, np.array([110.0, 110, 20, 20]))
    assert found == pytest.approx((0.8**0.5 - 0.8) / 0.2, abs=0.01)
    assert np.isnan(enhancer.over_enhancement(frame, np.array([300.0, 250, 10, 10])))  # all dark
    assert np.isnan(enhancer.over_enhancement(frame, np.array([900.0, 900, 10, 10])))  # outside
    assert enhancer.problem == ""


def test_a_wide_region_is_reduced_first() -> None:
    frame = np.full((1200, 1600, 3), 204, np.uint8)
    found = RunEnhancer(manifest("patch")).over_enhancement(frame, np.array([400.0, 300, 600, 500]))
    assert found == pytest.approx((0.8**0.5 - 0.8) / 0.2, abs=0.01)


def test_without_manifest_or_enhancer_nothing_is_measured() -> None:
    frame, box = np.full((64, 64, 3), 204, np.uint8), np.array([20.0, 20, 10, 10])
    for made in (None, manifest("patch", enhancer=None)):
        enhancer = RunEnhancer(made)
        assert enhancer.identity is None
        assert np.isnan(enhancer.over_enhancement(frame, box))
        assert enhancer.problem == ""


@pytest.mark.parametrize("origin", ["given", "fresh"])
def test_other_weights_do_not_pass_for_those_of_the_run(origin: str) -> None:
    weights = WeightsRecord(origin, "gone.pth" if origin == "given" else "", "0" * 64)
    record = PluginRecord("dcepp", weights=weights)
    with pytest.raises(WeightsMissing, match=r"no longer at hand|cannot be made again"):
        make_again(record)
    enhancer = RunEnhancer(manifest("patch", enhancer=record))
    frame = np.full((64, 64, 3), 204, np.uint8)
    assert np.isnan(enhancer.over_enhancement(frame, np.array([20.0, 20, 10, 10])))
    assert "dcepp" in enhancer.problem


def test_bundled_weights_are_found_again() -> None:
    from nat2024.registry import create_enhancer

    made = create_enhancer("dcepp")
    assert made.weights is not None
    weights = WeightsRecord("bundled", "/moved/elsewhere", made.weights.sha256)
    again = make_again(PluginRecord("dcepp", weights=weights))
    assert again.weights is not None
    assert again.weights.sha256 == made.weights.sha256
