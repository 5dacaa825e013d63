"""The conformance suite over all registered trackers."""

import pytest

import nat2024
from nat2024.testing import check_tracker

NEEDS_FILES = {"opencv_nano"}
WITHOUT_FILES = [name for name in nat2024.list_trackers() if name not in NEEDS_FILES]


@pytest.mark.parametrize("name", WITHOUT_FILES)
def test_trackers_without_files(name):
    import torch

    def make():
        torch.manual_seed(0)
        return nat2024.create_tracker(name, weights=False)

    check_tracker(make)


@pytest.mark.shared
@pytest.mark.parametrize("variant", ["v1", "v2"])
def test_opencv_nano(shared, variant):
    folder = shared / "parity" / "trackers" / "nanotrack"
    check_tracker(lambda: nat2024.create_tracker("opencv_nano", weights=folder, variant=variant))


def test_the_list_of_trackers_is_no_shorter_than_this():
    assert set(nat2024.list_trackers()) >= {
        "siamrpnpp",
        "opencv_nano",
        "mil",
        "mosse",
        "kcf",
        "fdsst",
    }
