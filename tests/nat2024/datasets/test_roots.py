import os

import pytest

from nat2024.datasets import configured_roots, find_root, load_dataset, read_configuration
from nat2024.errors import DatasetNotFound, UsageError


@pytest.fixture
def configure(tmp_path, monkeypatch):
    def write(text):
        (tmp_path / "config.toml").write_text(text)
        monkeypatch.setenv("NAT2024_CONFIG", str(tmp_path / "config.toml"))

    return write


def _datasets(tmp_path, make, *names):
    for name in names:
        make.apart(tmp_path / name / "UAVDark135", {name: 1})


def _loaded(root=None):
    return [s.name for s in load_dataset("uavdark135", root)]


def test_the_order_of_places(tmp_path, make, monkeypatch, configure):
    _datasets(tmp_path, make, "argument", "variable", "table", "shared", "configured")
    configure(f'root = "{tmp_path}/configured"')
    assert _loaded() == ["configured"]
    monkeypatch.setenv("NAT2024_ROOT", str(tmp_path / "shared"))
    assert _loaded() == ["shared"]
    configure(f'root = "configured"\n[roots]\nuavdark135 = "{tmp_path}/table/UAVDark135"')
    assert _loaded() == ["table"]
    monkeypatch.setenv("NAT2024_ROOT_UAVDARK135", str(tmp_path / "variable" / "UAVDark135"))
    assert _loaded() == ["variable"]
    assert _loaded(tmp_path / "argument" / "UAVDark135") == ["argument"]
    origins = [root.origin for root in configured_roots()]
    file = tmp_path / "config.toml"
    assert origins == ["NAT2024_ROOT_UAVDARK135", f"{file} [roots]", "NAT2024_ROOT", f"{file} root"]


def test_the_own_folder_or_one_that_holds_it(tmp_path, make):
    make.apart(tmp_path / "uavdark135", {"a": 1})
    assert find_root("uavdark135", tmp_path) == tmp_path / "uavdark135"
    assert find_root("uavdark135", tmp_path / "uavdark135") == tmp_path / "uavdark135"
    assert find_root("nat2024_2", str(tmp_path)) == tmp_path
    assert load_dataset("uavdark135", tmp_path).name == "uavdark135"


@pytest.mark.parametrize("folder", ["NAT2021-L-test", "NAT2021L", "nat2021_l_test"])
def test_other_folder_names(tmp_path, monkeypatch, folder):
    (tmp_path / folder).mkdir()
    monkeypatch.setenv("NAT2024_ROOT", str(tmp_path))
    assert find_root("nat2021_l_test") == tmp_path / folder


def test_relative_paths_of_the_configuration_start_at_its_folder(tmp_path, make, configure):
    make.apart(tmp_path / "night", {"a": 1})
    configure('[roots]\nuavdark135 = "night"')
    assert find_root("uavdark135") == tmp_path / "night"


def test_what_was_tried_and_where_to_get_it_is_said_in_one_line(tmp_path, monkeypatch):
    with pytest.raises(DatasetNotFound) as caught:
        find_root("uavdark135")
    message = str(caught.value)
    assert "NAT2024_ROOT_UAVDARK135 is not set" in message
    assert "no [roots] entry in" in message
    assert "NAT2024_ROOT is not set" in message
    assert "https://github.com/vision4robotics/ADTrack_v2" in message
    assert "anno_revise" in message
    assert "\n" not in message
    monkeypatch.setenv("NAT2024_ROOT", str(tmp_path))
    with pytest.raises(DatasetNotFound) as caught:
        find_root("nat2024_2")
    absent = tmp_path / "NAT2024-2"
    assert f"{absent} (NAT2024_ROOT) is absent" in str(caught.value)


def test_a_place_that_was_named_is_not_passed_over(tmp_path, make, monkeypatch):
    _datasets(tmp_path, make, "shared")
    monkeypatch.setenv("NAT2024_ROOT", str(tmp_path / "shared"))
    monkeypatch.setenv("NAT2024_ROOT_UAVDARK135", str(tmp_path / "typo"))
    with pytest.raises(DatasetNotFound, match=r"typo \(NAT2024_ROOT_UAVDARK135\) is absent"):
        load_dataset("uavdark135")
    (tmp_path / "file").write_text("x")
    with pytest.raises(DatasetNotFound, match=r"file \(root\) is a file"):
        load_dataset("uavdark135", tmp_path / "file")


def test_an_empty_folder_says_what_it_must_hold(tmp_path):
    with pytest.raises(DatasetNotFound, match=r"the folder is empty.*anno_revise/NAME\.txt"):
        load_dataset("uavdark135", tmp_path)


def test_no_configuration_is_an_empty_one():
    assert read_configuration().roots == {}
    assert configured_roots() == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('rots = "x"', "unknown field `rots`"),
        ("[roots]\nuavdark136 = 'x'", r"\[roots\] uavdark136: no such dataset; closest: uavdark1"),
        ("[roots]\nuavdark135 = 3", r"Expected `str`, got `int`"),
        ("root = ", "config.toml: "),
    ],
)
def test_a_wrong_configuration_names_file_and_key(tmp_path, configure, text, reason):
    configure(text)
    with pytest.raises(UsageError, match=reason):
        read_configuration()


def test_a_configuration_that_was_named_must_be_there(tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_CONFIG", str(tmp_path / "absent.toml"))
    with pytest.raises(UsageError, match=r"absent\.toml: no such file"):
        read_configuration()
    monkeypatch.setenv("NAT2024_CONFIG", str(tmp_path))
    with pytest.raises(UsageError, match="cannot be read"):
        read_configuration()


def test_a_home_folder_is_expanded(tmp_path, monkeypatch, make):
    make.apart(tmp_path / "night", {"a": 1})
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert find_root("uavdark135", f"~{os.sep}night") == tmp_path / "night"
    assert load_dataset("~/night").name == "night"
