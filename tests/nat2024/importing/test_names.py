"""Names of published result folders: every one becomes a tracker and an enhancer."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nat2024.importing import names_dataset, split_name

LDENHANCER = {
    "LDE-HiFT": ("hift", "ldenhancer"),
    "LDE-LPAT": ("lpat", "ldenhancer"),
    "LDE-SiamAPN": ("siamapn", "ldenhancer"),
    "LDE-SiamAPN++": ("siamapnpp", "ldenhancer"),
    "LDE-SiamRPN++": ("siamrpnpp", "ldenhancer"),
    "DCE++-SiamRPN++": ("siamrpnpp", "dcepp"),
    "DarkLighter-SiamRPN++": ("siamrpnpp", "darklighter"),
    "EnlightenGAN-SiamRPN++": ("siamrpnpp", "enlightengan"),
    "LIME-SiamRPN++": ("siamrpnpp", "lime"),
    "LLVE-SiamRPN++": ("siamrpnpp", "llve"),
    "RUAS-SiamRPN++": ("siamrpnpp", "ruas"),
    "SiamRPN++": ("siamrpnpp", "none"),
}
SCT = {
    "siamrpn_alex_dwxcorr": ("siamrpnpp", "none"),
    "siamrpn_alex_dwxcorr_DCE": ("siamrpnpp", "dce"),
    "siamrpn_alex_dwxcorr_DCE++": ("siamrpnpp", "dcepp"),
    "siamrpn_alex_dwxcorr_DarkLighter": ("siamrpnpp", "darklighter"),
    "siamrpn_alex_dwxcorr_EnlightenGAN": ("siamrpnpp", "enlightengan"),
    "siamrpn_alex_dwxcorr_LIME": ("siamrpnpp", "lime"),
    "siamrpn_alex_dwxcorr_LLVE": ("siamrpnpp", "llve"),
    "siamrpn_alex_dwxcorr_RUAS": ("siamrpnpp", "ruas"),
    "siamrpn_alex_dwxcorr_SCT": ("siamrpnpp", "sct"),
    "HiFT": ("hift", "none"),
    "HiFT_SCT": ("hift", "sct"),
    "SiamAPN++": ("siamapnpp", "none"),
    "SiamAPN++_SCT": ("siamapnpp", "sct"),
    "dimp18": ("dimp18", "none"),
    "dimp18_SCT": ("dimp18", "sct"),
    "dimp50": ("dimp50", "none"),
    "dimp50_SCT": ("dimp50", "sct"),
    "prdimp50": ("prdimp50", "none"),
    "prdimp50_SCT": ("prdimp50", "sct"),
}
DARKLIGHTER = {
    "dimp50_DCE": ("dimp50", "dce"),
    "dimp50_DarkLighter": ("dimp50", "darklighter"),
    "dimp50_EnlightenGAN": ("dimp50", "enlightengan"),
    "dimp50_LIME": ("dimp50", "lime"),
}
UDAT = {
    "SiamAPN": ("siamapn", "none"),
    "SiamRPN++_A": ("siamrpnpp", "none"),
    "UDAT-BAN": ("UDAT-BAN", "none"),
    "UDAT-CAR": ("UDAT-CAR", "none"),
    "d3s": ("d3s", "none"),
    "SiamFC++": ("SiamFC++", "none"),
    "DaSiamRPN": ("DaSiamRPN", "none"),
}
OTHERS = {
    "mil+gamma@soft": ("mil", "gamma"),
    "siamrpnpp@a.1": ("siamrpnpp@a.1", "none"),
    "opencv_nano": ("opencv_nano", "none"),
    "opencv_nano+clahe": ("opencv_nano", "clahe"),
    "kcf-he": ("kcf", "he"),
    "CLAHE_KCF": ("kcf", "clahe"),
    "fdsst_adtrack_tonemap": ("fdsst", "adtrack_tonemap"),
    "KinD++_nanotrack": ("nanotrack", "kindpp"),
    "dimp50-SCT": ("dimp50", "sct"),
    "Zero-DCE++_HiFT": ("hift", "dcepp"),
    "HiFT_Zero-DCE": ("hift", "dce"),
    "SCT": ("SCT", "none"),
    "_SCT": ("_SCT", "none"),
    "SE-SiamFC++": ("SE-SiamFC++", "none"),
    "My Tracker (v2)": ("My Tracker (v2)", "none"),
}


@pytest.mark.parametrize(
    ("name", "expected"),
    [*LDENHANCER.items(), *SCT.items(), *DARKLIGHTER.items(), *UDAT.items()],
)
def test_every_published_folder_name(name: str, expected: tuple[str, str]) -> None:
    assert split_name(name) == expected


@pytest.mark.parametrize(("name", "expected"), OTHERS.items())
def test_generic_forms_and_names_that_stay_whole(name: str, expected: tuple[str, str]) -> None:
    tracker, enhancer = split_name(name)
    assert (tracker, enhancer.partition("@")[0]) == expected


def test_labels_of_our_own_names_stay() -> None:
    assert split_name("mil+gamma@soft") == ("mil", "gamma@soft")
    assert split_name("siamrpnpp@a.1+ldenhancer@epoch-99") == (
        "siamrpnpp@a.1",
        "ldenhancer@epoch-99",
    )


@given(st.text(min_size=1))
def test_any_name_has_a_tracker(name: str) -> None:
    tracker, enhancer = split_name(name)
    assert tracker
    assert enhancer


@pytest.mark.parametrize(
    ("folder", "dataset"),
    [
        ("UAVDark135", "uavdark135"),
        ("NAT2024-2", "nat2024_2"),
        ("NAT2021", "nat2021_test"),
        ("NAT2021L", "nat2021_l_test"),
        ("DTB70", "DTB70"),
        ("my_clip", "my clip"),
    ],
)
def test_folders_named_as_datasets(folder: str, dataset: str) -> None:
    assert names_dataset(folder, dataset)


def test_datasets_that_share_a_beginning_differ() -> None:
    assert not names_dataset("NAT2021", "nat2021_l_test")
    assert not names_dataset("NAT2021L", "nat2021_test")
    assert not names_dataset("UAVDark70", "uavdark135")
    assert names_dataset("UAVDark70")
    assert not names_dataset("others")
