"""The order in which weights are looked for, and what a digest covers."""

import dataclasses
import shutil

import pytest

from nat2024.cards import Card, WeightsFile
from nat2024.errors import WeightsMismatch, WeightsMissing
from nat2024.zoo import Weights, bundled_path, find_weights, sha256_of
from nat2024.zoo.registered import RegisteredWeights, entry_name, plugin_folder, store


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path / "registered"))


@pytest.fixture
def bundle(tmp_path, monkeypatch):
    """A card whose second file comes with an importable package."""
    package = f"package_{abs(hash(tmp_path))}"  # another one for each test
    data = tmp_path / "site" / package / "bundled"
    data.mkdir(parents=True)
    (data.parent / "__init__.py").write_text("")
    (data / "small.safetensors").write_bytes(b"weights")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    file = WeightsFile(
        "small.safetensors",
        "comes with it",
        "Apache-2.0",
        sha256=sha256_of(data / "small.safetensors"),
        bundled=f"{package}/bundled/small.safetensors",
    )
    official = WeightsFile("model.pth", "somewhere", "none stated")
    return Card(title="Net", summary="", weights=(official, file)), data / "small.safetensors"


def register(name, content, **options):
    path = plugin_folder(name) / "stored.safetensors"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    record = RegisteredWeights(
        plugin=name,
        options=options,
        source="/somewhere/model.pth",
        source_sha256="0" * 64,
        known_as="model.pth",
        file=path.name,
        form="copy",
        sha256=sha256_of(path),
        bytes=len(content),
    )
    store(record)
    return path


def test_registered_weights_come_before_bundled_ones(bundle):
    card, path = bundle
    assert find_weights("net", None, card).path == path
    stored = register("net", b"mine")
    found = find_weights("net", None, card)
    assert (found.path, found.origin, found.known_as) == (stored, "registered", "model.pth")
    assert found.sha256 == "0" * 64


def test_registered_weights_with_options_are_for_who_asks_for_them(bundle):
    register("net", b"mine", variant="large")
    assert find_weights("net", None, bundle[0]).origin == "bundled"


def test_bundled_weights_are_known_and_checked(bundle):
    card, path = bundle
    found = find_weights("net", None, card)
    assert (found.origin, found.known_as) == ("bundled", "small.safetensors")
    assert found.sha256 == sha256_of(path)
    assert [bundled_path(file) for file in card.weights] == [None, path]
    path.write_bytes(b"other")
    with pytest.raises(WeightsMismatch, match="the bundled weights of net are damaged"):
        find_weights("net", None, card)
    path.unlink()
    with pytest.raises(WeightsMismatch, match="install the package anew"):
        find_weights("net", None, card)


def test_found_weights_are_taken_as_they_are(tmp_path):
    weights = Weights(tmp_path, "registered", options={"variant": "x"})
    assert find_weights("net", weights, Card(title="", summary="")) is weights
    assert dataclasses.replace(weights, sha256="1").options == {"variant": "x"}


def test_nothing_at_hand_says_what_to_do():
    card = Card(title="", summary="", weights=(WeightsFile("a.pth", "the zoo", "MIT"),))
    with pytest.raises(WeightsMissing) as caught:
        find_weights("net", None, card)
    assert str(caught.value) == (
        "no weights for net: pass them with --weights net=PATH (weights=PATH in Python), or "
        "register them once with nat-bench weights import net FILE; the official file is a.pth "
        "from the zoo"
    )


def test_a_digest_covers_names_and_contents_of_all_files_in_a_folder(tmp_path):
    folder = tmp_path / "folder"
    (folder / "part").mkdir(parents=True)
    (folder / "a").write_bytes(b"1")
    (folder / "part" / "b").write_bytes(b"2")
    first = sha256_of(folder)
    shutil.copytree(folder, tmp_path / "copy")
    assert sha256_of(tmp_path / "copy") == first
    (folder / "part" / "b").write_bytes(b"3")
    second = sha256_of(folder)
    (folder / "part" / "b").rename(folder / "part" / "c")
    assert len({first, second, sha256_of(folder)}) == 3


def test_a_digest_of_several_files_is_that_of_a_folder_with_them(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(name.encode())
    assert sha256_of(tmp_path / "b", tmp_path / "a") == sha256_of(tmp_path)


def test_entry_names_depend_on_the_options_alone():
    assert entry_name({}) == "default"
    assert entry_name({"a": 1, "b": "x"}) == entry_name({"b": "x", "a": 1})
    assert entry_name({"a": 1}) != entry_name({"a": "1"})


def test_without_the_variable_the_users_data_folder_is_taken(monkeypatch, tmp_path):
    from nat2024.zoo.registered import weights_folder

    monkeypatch.delenv("NAT2024_WEIGHTS")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert weights_folder().name == "weights"
    assert weights_folder().is_relative_to(tmp_path)
    monkeypatch.setenv("NAT2024_WEIGHTS", "~/mine")
    assert weights_folder() == tmp_path / "mine"
