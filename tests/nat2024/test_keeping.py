"""Entries under digests: found again, or as if they had never been."""

import os
from pathlib import Path

import numpy as np
import pytest

from nat2024.keeping import Keeper, cache_folder, digest, trim


def test_cache_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NAT2024_CACHE", "~/kept")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "kept"
    monkeypatch.delenv("NAT2024_CACHE")
    assert cache_folder().name == "nat-bench"


def test_digest_tells_values_apart() -> None:
    boxes = np.arange(8.0)
    values = [
        (boxes,),
        (boxes.reshape(2, 4),),
        (boxes.astype(np.float32),),
        (-boxes,),
        (boxes[:0],),
        (None,),
        (b"",),
        ("",),
        (b"a", b"b"),
        (b"ab",),
        ({"a": 1},),
        ({"a": 1.5},),
        (["a", 1],),
        (np.array([0.0]),),
        (np.array([-0.0]),),
        (np.array([np.nan]),),
    ]
    assert len({digest(*one) for one in values}) == len(values)
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest(boxes[::2]) == digest(boxes[::2].copy())


def keep(path: Path, **entries: int) -> None:
    keeper = Keeper(path, most_unused=2)
    for key, value in entries.items():
        keeper.put(key, value)
    assert keeper.save() is None


def test_entries_come_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "some.msgpack"
    keep(path, a=1, b=2)
    keeper = Keeper(path, most_unused=2)
    assert (keeper.get("a", int), keeper.get("b", int)) == (1, 2)
    assert keeper.get("c", int) is keeper.get(None, int) is keeper.get("a", str) is None
    assert [one.name for one in path.parent.iterdir()] == ["some.msgpack"]


def test_the_oldest_that_nobody_asked_for_go(tmp_path: Path) -> None:
    path = tmp_path / "some"
    keep(path, a=1, b=2, c=3, d=4)
    keeper = Keeper(path, most_unused=2)
    assert keeper.get("a", int) == 1
    keeper.put("e", 5)
    keeper.save()
    kept = Keeper(path, most_unused=2)
    assert [kept.get(key, int) for key in "abcde"] == [1, None, 3, 4, 5]


def test_damage_is_as_none(tmp_path: Path) -> None:
    path = tmp_path / "some"
    keep(path, a=1)
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert Keeper(path, most_unused=2).get("a", int) is None
        path.write_bytes(whole[:place])
        assert Keeper(path, most_unused=2).get("a", int) is None
    keep(path, b=2)
    assert Keeper(path, most_unused=2).get("b", int) == 2


def test_what_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    keeper = Keeper(tmp_path / "file" / "some", most_unused=2)
    keeper.put("a", 1)
    assert "cannot be written" in str(keeper.save())
    nowhere = Keeper(None, most_unused=2)
    nowhere.put("a", 1)
    assert nowhere.save() is None


def test_trim_deletes_what_was_not_used_for_longest(tmp_path: Path) -> None:
    for age, name in enumerate("abc"):
        keep(tmp_path / name, key=1)
        os.utime(tmp_path / name, (1000 - age, 1000 - age))
    keeper = Keeper(tmp_path / "c", most_unused=2)
    keeper.get("key", int)
    keeper.save()  # nothing new, but it is in use
    size = (tmp_path / "a").stat().st_size
    trim(tmp_path, 2 * size)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a", "c"]
    trim(tmp_path / "absent", 0)
