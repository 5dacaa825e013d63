"""Shards of a run, brought together: as if it had been one."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

import nat2024
from nat2024.cli import run as nat_bench
from nat2024.engine import combine, merge_results, run_benchmark, shard
from nat2024.errors import DatasetNotFound, ResultConflict
from nat2024.store import RunFolder

pytestmark = pytest.mark.usefixtures("small_plugins")


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


def change(path: Path, **entries: Any) -> None:
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, **entries}))


def test_what_does_not_belong_together_is_refused_and_nothing_written(
    tmp_path: Path, shards: list[Path]
) -> None:
    manifest = shards[1] / "night_clip" / "still+clahe" / "run.json"
    original = manifest.read_text()
    cases: list[tuple[dict[str, Any], str]] = [
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
    }
    assert nat_bench([*words, "--results", str(tmp_path / "x"), "--shard", "3"]) == 2
    assert "--shard '3': expected I/N, such as 2/8" in capsys.readouterr().err
