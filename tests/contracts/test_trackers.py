"""The conformance suite over all registered trackers."""

import pytest

import nat2024
from nat2024.testing import check_tracker

NEEDS_FILES = {"opencv_nano", "opencv_vit", "opencv_dasiamrpn"}
NEEDS_CONTRIB = {"opencv_csrt", "opencv_kcf"}
WITHOUT_FILES = [name for name in nat2024.list_trackers() if name not in NEEDS_FILES]


@pytest.mark.parametrize("name", WITHOUT_FILES)
def test_trackers_without_files(name):
    import torch

    def make():
        torch.manual_seed(0)
        return nat2024.create_tracker(name, weights=False)

    if name in NEEDS_CONTRIB:
        try:
            make()
        except nat2024.NatBenchError as error:
            pytest.skip(str(error))
    check_tracker(make)


@pytest.mark.shared
@pytest.mark.parametrize("variant", ["v1", "v2"])
def test_opencv_nano(shared, variant):
    folder = shared / "parity" / "trackers" / "nanotrack"
    check_tracker(lambda: nat2024.create_tracker("opencv_nano", weights=folder, variant=variant))


@pytest.mark.shared
@pytest.mark.parametrize("variant", ["v1", "v2", "v3"])
def test_nanotrack_in_opencv(shared, variant):
    folder = shared / "parity" / "trackers" / "nanotrack"
    check_tracker(
        lambda: nat2024.create_tracker(
            "nanotrack", weights=folder, variant=variant, runtime="opencv"
        )
    )


def test_the_list_of_trackers_is_no_shorter_than_this():
    assert set(nat2024.list_trackers()) >= {
        "siamrpnpp",
        "siamapn",
        "siamapnpp",
        "hift",
        "lpat",
        "nanotrack",
        "opencv_nano",
        "opencv_vit",
        "opencv_dasiamrpn",
        "mil",
        "mosse",
        "kcf",
        "fdsst",
    }
