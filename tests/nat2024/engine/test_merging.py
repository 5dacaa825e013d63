"""Shards of a run, brought together: as if it had been one."""

import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

import nat2024
from nat2024.cli import run as nat_bench
from nat2024.engine import combine, merge_results, merging, run_benchmark, shard
from nat2024.errors import DatasetNotFound, ResultConflict
from nat2024.files import temporary_beside, write_atomic
from nat2024.store import RunFolder

pytestmark = pytest.mark.usefixtures("small_plugins")

_NO_PROCESS = 1 << 22
"""More than Linux gives."""


def box_files(results: Path) -> dict[str, bytes]:
    return {str(p.relative_to(results)): p.read_bytes() for p in sorted(results.rglob("*.txt"))}


@pytest.fixture
def shards(night_clip: Path, tmp_path: Path) -> list[Path]:
    """Results of the three shards of two combinations, one of which fails on `wide`."""
    dataset = nat2024.load_dataset(night_clip)
    for number in (1, 2, 3):
        part = shard(dataset, number, 3)
        run_benchmark(combine(["still", "fails"], ["clahe"]), part, tmp_path / f"shard{number}")
    return [tmp_path / f"shard{number}" for number in (1, 2, 3)]


def test_shards_together_are_the_whole(
    night_clip: Path, tmp_path: Path, shards: list[Path]
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    combinations = combine(["still", "fails"], ["clahe"])
    run_benchmark(combinations, dataset, tmp_path / "whole")
    report = merge_results(shards, tmp_path / "merged")
    assert report.runs == ("night_clip/fails+clahe", "night_clip/still+clahe")
    assert (report.copied, report.present, report.failures) == (5, 0, 1)
    assert box_files(tmp_path / "merged") == box_files(tmp_path / "whole")
    for run in report.runs:
        merged = RunFolder(tmp_path / "merged" / run).manifest()
        whole = RunFolder(tmp_path / "whole" / run).manifest()
        assert merged is not None
        assert whole is not None
        assert merged.starts == whole.starts
        assert merged.failures == whole.failures
        assert len(merged.sessions) == 3
        assert merged.timing is not None
        assert merged.timing.frames == (24 if "still" in run else 16)
    again = run_benchmark(combinations, dataset, tmp_path / "merged")
    assert (again.tracked, again.skipped) == (0, 5)  # `wide` fails once more


def test_merging_twice_changes_nothing(tmp_path: Path, shards: list[Path]) -> None:
    merge_results(shards[:2], tmp_path / "merged")
    report = merge_results(shards, tmp_path / "merged")
    before = {p: p.read_bytes() for p in (tmp_path / "merged").rglob("*") if p.is_file()}
    assert report.copied + report.present == 5
    report = merge_results(shards, tmp_path / "merged")
    assert (report.copied, report.present) == (0, 5)
    assert {p: p.read_bytes() for p in (tmp_path / "merged").rglob("*") if p.is_file()} == before


def test_a_merge_that_is_cut_off_can_be_done_again(
    tmp_path: Path, shards: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    merge_results(shards, tmp_path / "whole")
    for files in range(10):
        left = [None] * files

        def cut_off(path: Path, raw: bytes, left: list[None] = left) -> None:
            if not left:
                raise KeyboardInterrupt
            left.pop()
            write_atomic(path, raw)

        out = tmp_path / f"after {files}"
        with monkeypatch.context() as patched:
            patched.setattr(merging, "write_atomic", cut_off)
            with pytest.raises(KeyboardInterrupt):
                merge_results(shards, out)
        half = temporary_beside(out / "night_clip" / "still+clahe" / "time" / "narrow.csv")
        half = half.with_name(half.name.replace(f"-{os.getpid()}-", f"-{_NO_PROCESS}-"))
        half.parent.mkdir(exist_ok=True, parents=True)
        half.write_bytes(b"0.1,")
        report = merge_results(shards, out)
        assert not half.exists()
        assert report.copied + report.present == 5
        assert box_files(out) == box_files(tmp_path / "whole")
        for run in report.runs:
            assert RunFolder(out / run).manifest() == RunFolder(tmp_path / "whole" / run).manifest()


def change(path: Path, **entries: Any) -> None:
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, **entries}))


def test_what_does_not_belong_together_is_refused_and_nothing_written(
    tmp_path: Path, shards: list[Path]
) -> None:
    manifest = shards[1] / "night_clip" / "still+clahe" / "run.json"
    original = manifest.read_text()
    tracker = json.loads(original)["tracker"]
    weights = {"origin": "given", "path": "/x.pth", "sha256": "ab" * 32}
    cases: list[tuple[dict[str, Any], str]] = [
        ({"tracker": {**tracker, "weights": weights}}, r"weights of still unset \(now ababab"),
        ({"threads": 2}, r"threads 1 \(now 2\)"),
        ({"batch": 4}, r"batch 1 \(now 4\)"),
        ({"scope": "patch"}, r"scope frame \(now patch\)"),
        ({"dataset": {"name": "night_clip", "lenient": True}}, "dataset lenient False"),
    ]
    first = json.loads((shards[0] / "night_clip/still+clahe/run.json").read_text())["starts"]
    cases.append(({"starts": dict.fromkeys(first, "0" * 16)}, "length or first box of"))
    for entries, message in cases:
        change(manifest, **entries)
        with pytest.raises(ResultConflict, match=message):
            merge_results(shards, tmp_path / "merged")
        manifest.write_text(original)
    assert not (tmp_path / "merged").exists()


def test_other_boxes_of_one_sequence_are_refused(tmp_path: Path, shards: list[Path]) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(shards[0], copy)
    [name] = RunFolder(copy / "night_clip" / "still+clahe").finished()
    path = copy / "night_clip" / "still+clahe" / f"{name}.txt"
    assert merge_results([shards[0], copy], tmp_path / "same").copied >= 1
    path.write_text("1,2,3,4\n" * 8)
    with pytest.raises(ResultConflict, match=rf"{name}\.txt hold other boxes; remove one"):
        merge_results([shards[0], copy], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_other_versions_are_refused_unless_they_are_asked_for(
    tmp_path: Path, shards: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path = shards[1] / "night_clip" / "still+clahe" / "run.json"
    sessions = json.loads(path.read_text())["sessions"]
    torch = sessions[0]["versions"]["torch"]
    for name in ("python", "revision", "torch"):
        sessions[0]["versions"][name] = "1.0"
        change(path, sessions=sessions)
        if name != "torch":  # these are told by the version of nat-bench
            merge_results(shards, tmp_path / name)
    with pytest.raises(ResultConflict, match=rf"torch {re.escape(torch)} \(now 1\.0\)"):
        merge_results(shards, tmp_path / "merged")
    assert not (tmp_path / "merged").exists()
    words = ["merge", *map(str, shards), "--out", str(tmp_path / "merged"), "--other-versions"]
    assert nat_bench(words) == 1  # `fails` fails
    assert len(box_files(tmp_path / "merged")) == 5


def test_what_is_missing_is_named(
    night_clip: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    for number in (1, 2, 3):
        part = shard(dataset, number, 3)
        results = tmp_path / str(number)
        run_benchmark(combine(["still"], ["none"]), part, results, shard=f"{number}/3")
    report = merge_results([tmp_path / "1", tmp_path / "3"], tmp_path / "all")
    assert report.incomplete == ("night_clip/still: without shard 2 of 3",)
    assert caplog.messages == list(report.incomplete)
    report = merge_results([tmp_path / "2"], tmp_path / "all")
    assert report.incomplete == ()
    [name] = RunFolder(tmp_path / "2" / "night_clip" / "still").finished()
    for folder in ("2", "all"):
        RunFolder(tmp_path / folder / "night_clip" / "still").box_file(name).unlink()
    report = merge_results([tmp_path / "2"], tmp_path / "all")
    assert report.incomplete == (f"night_clip/still: begun and not finished: {name}",)


@pytest.mark.parametrize(
    ("claimed", "told"),
    [
        ("1/x", ()),
        ("1/0", ()),
        ("3/1e9", ()),
        ("1/999999999", ("night_clip/still: without shard 2, 3, 4, 5, 6, ... of 999999999",)),
    ],
)
def test_manifests_of_strangers_claim_any_shard(
    night_clip: Path, tmp_path: Path, claimed: str, told: tuple[str, ...]
) -> None:
    dataset = nat2024.load_dataset(night_clip)
    run_benchmark(combine(["still"], ["none"]), dataset, tmp_path / "theirs", shard=claimed)
    report = merge_results([tmp_path / "theirs"], tmp_path / "merged")
    assert (report.copied, report.incomplete) == (3, told)


@pytest.mark.parametrize("name", ["a" * 5000, "../../outside", "nul\0"])
def test_names_of_failures_in_manifests_are_no_paths(
    night_clip: Path, tmp_path: Path, name: str
) -> None:
    (tmp_path / "results").mkdir()
    outside = tmp_path / "results" / "outside.txt"
    outside.write_text("1,2,3,4\n")
    dataset, results = nat2024.load_dataset(night_clip), tmp_path / "results"
    few = dataset.select(["narrow"])
    run_benchmark(combine(["still"], ["none"]), few, results)
    change(results / "night_clip" / "still" / "run.json", failures={name: "why"})
    assert merge_results([results], tmp_path / "merged").failures == 1
    run_benchmark(combine(["still"], ["none"]), dataset, results)
    manifest = RunFolder(results / "night_clip" / "still").manifest()
    assert manifest is not None
    assert manifest.failures == {name: "why"}


def test_shards_that_overlap_must_agree(night_clip: Path, tmp_path: Path) -> None:
    dataset = nat2024.load_dataset(night_clip)
    for number, count in ((1, 2), (2, 2), (1, 3)):
        part = shard(dataset, number, count)
        results = tmp_path / f"{number}-{count}"
        run_benchmark(combine(["still"], ["none"]), part, results, shard=f"{number}/{count}")
    report = merge_results([tmp_path / "1-2", tmp_path / "2-2", tmp_path / "1-3"], tmp_path / "all")
    assert (report.copied, report.incomplete) == (3, ())
    options = {"still": {"step": 1.0}}
    other = combine(["still"], ["none"], options=options)
    run_benchmark(other, shard(dataset, 2, 3), tmp_path / "other")
    with pytest.raises(ResultConflict, match=r"still\.step 0\.0 \(now 1\.0\)"):
        merge_results([tmp_path / "1-2", tmp_path / "other"], tmp_path / "mixed")


def test_sources_without_results_or_manifests(tmp_path: Path, shards: list[Path]) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetNotFound, match="no results in it"):
        merge_results([shards[0], tmp_path / "empty"], tmp_path / "merged")
    (shards[1] / "night_clip" / "still+clahe" / "run.json").unlink()
    with pytest.raises(ResultConflict, match=r"holds results without run\.json"):
        merge_results(shards, tmp_path / "merged")


def test_from_the_command_line(
    night_clip: Path, tmp_path: Path, small_plugins: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "--tracker", "still", "--dataset", str(night_clip), "--plugin", small_plugins]
    words += ["--device", "cpu"]
    for number in (1, 2):
        out = ["--results", str(tmp_path / str(number)), "--shard", f"{number}/2"]
        assert nat_bench([*words, *out]) == 0
    assert "shard 2/2: 1 of 3 sequences" in capsys.readouterr().err
    merge = ["merge", str(tmp_path / "1"), str(tmp_path / "2"), "--out", str(tmp_path / "all")]
    assert nat_bench(merge) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'all'}: 1 runs, 3 sequences\n"
    assert nat_bench([*merge, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == {
        "folder": str(tmp_path / "all"),
        "runs": ["night_clip/still"],
        "copied": 0,
        "present": 3,
        "failures": 0,
        "incomplete": [],
    }
    assert nat_bench([*words, "--results", str(tmp_path / "x"), "--shard", "3"]) == 2
    assert "--shard '3': expected I/N, such as 2/8" in capsys.readouterr().err
