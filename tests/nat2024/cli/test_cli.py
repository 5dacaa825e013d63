"""The command line as a user meets it: outputs, exit statuses, one line for each mistake."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from nat2024 import list_trackers
from nat2024.cli import main


@pytest.fixture
def results(night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any) -> Path:
    """Results of `still`, alone and with two enhancers."""
    folder = tmp_path / "results"
    words = [
        "run",
        "--tracker",
        "still",
        "--enhancer",
        "none",
        "--enhancer",
        "gamma",
        "--enhancer",
        "clahe",
        "--quiet",
    ]
    status, _, _ = cli(*words, "--dataset", night_clip, "--results", folder)
    assert status == 0
    return folder


def test_help_lists_every_verb(cli: Any) -> None:
    status, out, _ = cli("--help")
    assert status == 0
    for verb in ("run", "eval", "table", "list", "dataset"):
        assert f"\n  {verb} " in out


@pytest.mark.parametrize("verb", ["run", "eval", "table", "list", "dataset"])
def test_every_verb_has_help_with_the_same_first_line(cli: Any, verb: str) -> None:
    status, out, _ = cli(verb, "--help")
    assert status == 0
    assert f"Usage: nat-bench {verb}" in out


def test_run_ends_in_the_table(
    night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any
) -> None:
    words = ("run", "--tracker", "still", "--enhancer", "none", "--enhancer", "invert")
    folders = ("--dataset", night_clip, "--results", tmp_path, "--plugin", small_plugins)
    status, out, err = cli(*words, *folders)
    assert status == 0
    assert "6 tracked, 0 finished before" in err
    assert "night_clip: 3 sequences, 24 frames; protocol pysot" in out
    assert max(map(len, out.splitlines())) <= 100
    status, out, err = cli(*words, *folders)
    assert "0 tracked, 6 finished before" in err


def test_run_as_json(night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any) -> None:
    words = ("run", "--tracker", "fails", "--dataset", night_clip, "--results", tmp_path, "--json")
    status, out, err = cli(*words)
    assert status == 1
    document = json.loads(out)
    assert document["runs"] == ["fails"]
    assert document["tracked"] == 2
    assert document["failures"][0]["sequence"] == "wide"
    assert "fails, wide: frame 5 of 8: ValueError: lost its mind" in err


def test_labels_options_and_sequences(
    night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any
) -> None:
    status, _, _ = cli(
        *("run", "--tracker", "still@fast", "--opt", "still@fast.step=1.5", "--quiet"),
        *("--enhancer", "gamma@dark", "--opt", "gamma@dark.gamma=2"),
        *("--sequences", "wide,tall", "--dataset", night_clip, "--results", tmp_path),
    )
    assert status == 0
    folder = tmp_path / "night_clip" / "still@fast+gamma@dark"
    assert sorted(p.name for p in folder.iterdir()) == ["run.json", "tall.txt", "time", "wide.txt"]
    stored = json.loads((folder / "run.json").read_text())
    assert stored["tracker"]["options"]["step"] == 1.5
    assert stored["enhancer"]["options"]["gamma"] == 2.0


def test_eval_as_json_has_the_promised_columns(results: Path, cli: Any) -> None:
    status, out, _ = cli("eval", "--results", results, "--json")
    assert status == 0
    document = json.loads(out)
    promised = {"protocol", "summary", "per_sequence", "per_attribute", "notes"}
    assert set(document) == promised | {"per_category", "gains"}
    assert document["protocol"] == "pysot"
    assert list(document["summary"][0])[:12] == [
        "dataset",
        "run",
        "tracker",
        "enhancer",
        "scope",
        "protocol",
        "sequences",
        "frames",
        "success_auc",
        "precision_20",
        "normalized_precision_20",
        "normalized_precision_auc",
    ]
    assert [row["enhancer"] for row in document["summary"]] == ["none", "clahe", "gamma"]
    assert len(document["per_sequence"]) == 9
    assert {row["sequence"] for row in document["per_sequence"]} == {"narrow", "tall", "wide"}
    assert document["summary"][0]["average_overlap"] is None  # NaN is no JSON
    gains = [(row["run"], row["base"], row["metric"]) for row in document["gains"]]
    assert len(gains) == 2 * 3
    assert {base for _, base, _ in gains} == {document["summary"][0]["run"]}


def test_a_dataset_that_is_gone_hides_no_other(
    results: Path, night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    gone = tmp_path / "gone"
    shutil.copytree(night_clip, gone)
    cli("run", "--tracker", "still", "--dataset", gone, "--results", results)
    shutil.rmtree(gone)
    status, out, err = cli("eval", "--results", results)
    assert status == 0
    assert "night_clip: 3 sequences" in out
    assert "left out: " in err
    assert "name it with --dataset if it has moved" in err


def test_a_bad_foreign_result_does_not_spoil_a_run(
    results: Path, night_clip: Path, cli: Any
) -> None:
    foreign = results / "night_clip" / "Foreign"
    foreign.mkdir()
    (foreign / "wide.txt").write_text("1,2,3,4\n")
    words = ("run", "--tracker", "still", "--dataset", night_clip, "--results", results)
    status, out, _ = cli(*words)
    assert status == 0
    assert "3 sequences, 24 frames" in out


def test_no_cache(cli: Any, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "kept"))
    words = ("eval", "--results", results, "--json")
    without = cli(*words, "--no-cache")
    assert not (tmp_path / "kept" / "scores").exists()
    assert cli(*words) == without
    assert list((tmp_path / "kept" / "scores").iterdir())
    assert cli(*words) == without


def test_eval_by_sequence_and_protocol(results: Path, cli: Any) -> None:
    status, out, _ = cli("eval", "--results", results, "--by", "sequence", "--protocol", "strict")
    assert status == 0
    assert "protocol strict" in out
    assert sum(" still+gamma " in line for line in out.splitlines()) == 3


def test_eval_takes_the_folder_of_one_dataset(results: Path, cli: Any) -> None:
    one = cli("eval", "--results", results, "--json")[1]
    other = cli("eval", "--results", results / "night_clip", "--json")[1]
    assert one == other


def test_tables_in_every_format(results: Path, tmp_path: Path, cli: Any) -> None:
    _, console, _ = cli("table", "--results", results)
    assert "Precision" in console
    _, markdown, _ = cli("table", "--results", results, "--format", "markdown")
    assert "| Tracker | Enhancer | Success | gain % |" in markdown
    _, csv, _ = cli("table", "--results", results, "--format", "csv")
    assert csv.startswith("Dataset,Protocol,Tracker,Enhancer,Scope,Success,Success gain %")
    out = tmp_path / "table.tex"
    status, printed, _ = cli("table", "--results", results, "--format", "latex", "--out", out)
    assert (status, printed) == (0, "")
    assert r"\toprule" in out.read_text()


def test_missing_sequences_and_bad_rows_are_told(results: Path, cli: Any) -> None:
    folder = results / "night_clip" / "still"
    (folder / "tall.txt").unlink()
    text = (folder / "wide.txt").read_text().splitlines()
    (folder / "wide.txt").write_text("\n".join([*text[:-1], "NaN,NaN,NaN,NaN"]))
    status, out, err = cli("eval", "--results", results, "--json")
    assert status == 0
    assert "still: no result of 1 sequence, tall" in err
    assert "still: 1 bad result rows in wide" in err
    notes = json.loads(out)["notes"]["night_clip"]
    assert notes["missing_sequences"] == {"still": ["tall"]}
    assert notes["bad_result_rows"] == {"still": {"wide": 1}}


def test_unequal_lengths_follow_on_length(results: Path, cli: Any) -> None:
    path = results / "night_clip" / "still" / "wide.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:5]))
    status, out, err = cli("eval", "--results", results)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "wide.txt" in err
    assert "5" in err
    assert "8" in err
    assert cli("eval", "--results", results, "--on-length", "pad")[0] == 0
    assert cli("eval", "--results", results, "--on-length", "cut")[0] == 0


def test_lenient_cuts_sequences_whose_boxes_and_frames_differ(
    night_clip: Path, tmp_path: Path, small_plugins: str, cli: Any
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    (copy / "data_seq" / "tall" / "00008.png").unlink()
    words = ("run", "--tracker", "still", "--dataset", copy, "--results", tmp_path / "r")
    status, out, err = cli(*words)
    assert (status, out) == (2, "")
    assert "tall" in err
    assert cli(*words, "--lenient")[0] == 0
    status, out, _ = cli("eval", "--results", tmp_path / "r", "--json")
    assert status == 0
    assert json.loads(out)["summary"][0]["frames"] == 23


def test_list_shows_plugins_with_their_options(cli: Any, small_plugins: str) -> None:
    status, out, _ = cli("list", "--json")
    assert status == 0
    document = json.loads(out)
    by_name = {row["name"]: row for row in document["trackers"]}
    assert by_name["still"]["options"]["step"] == 0.0
    assert by_name["siamrpnpp"]["card"]["needs_weights"] is True
    assert {"uavdark135", "nat2024_2"} <= {row["name"] for row in document["datasets"]}
    _, out, _ = cli("list", "--enhancers", "l*")
    assert "ldenhancer" in out
    assert "gamma" not in out


def test_list_names_the_closest_where_nothing_has_a_name(cli: Any) -> None:
    for words in (["ldenhancr"], ["ldenhancr", "--card"], ["ldenhancr", "--json"]):
        status, out, err = cli("list", *words)
        assert (status, out) == (2, "")
        assert "nothing here is named 'ldenhancr'; closest: ldenhancer" in err
    assert cli("list", "nothing*")[0] == 0


def test_list_keeps_names_in_one_piece(cli: Any) -> None:
    _, out, _ = cli("list", "--trackers")
    names = {line.split()[0] for line in out.splitlines() if line.strip()}
    assert set(list_trackers()) <= names


def test_list_marks_a_broken_plugin(cli: Any, monkeypatch: Any) -> None:
    from nat2024 import registry

    def explode() -> type:
        message = "no such library"
        raise ImportError(message)

    entry = registry.Entry("broken", "enhancer", "broken:Broken", explode)
    monkeypatch.setitem(registry._registered, "broken", entry)
    status, out, _ = cli("list", "--enhancers", "--json")
    assert status == 0
    row = next(r for r in json.loads(out)["enhancers"] if r["name"] == "broken")
    assert "no such library" in row["state"]


def test_dataset_info_and_validate(night_clip: Path, cli: Any) -> None:
    status, out, _ = cli("dataset", "info", night_clip)
    assert status == 0
    assert "frames: 24 in 3 sequences" in out
    assert "160x96" in out
    document = json.loads(cli("dataset", "info", night_clip, "--json")[1])
    assert [one["name"] for one in document["sequences"]] == ["narrow", "tall", "wide"]
    status, out, _ = cli("dataset", "validate", night_clip)
    assert status == 0
    assert out.endswith("ok\n")


def test_validate_says_what_is_wrong(night_clip: Path, tmp_path: Path, cli: Any) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(night_clip, copy)
    (copy / "data_seq" / "tall" / "00008.png").unlink()
    status, out, _ = cli("dataset", "validate", copy)
    assert status == 1
    assert "problem: tall" in out
    assert "7" in out
    assert "8" in out


def test_synthesize_writes_a_dataset_and_never_over_another(tmp_path: Path, cli: Any) -> None:
    status, _, err = cli("dataset", "synthesize", tmp_path / "clip", "--frames", 3)
    assert status == 0
    assert "2 sequences of 3 frames" in err
    assert len(list((tmp_path / "clip" / "data_seq" / "person1").glob("*.jpg"))) == 3
    status, _, err = cli("dataset", "synthesize", tmp_path / "clip")
    assert status == 2
    assert "is not empty" in err


@pytest.mark.usefixtures("small_plugins")
@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("rnu", "no such command 'rnu'; closest: run"),
        ("run --quiet --dataset {clip} --opt still.step=1", "still"),
        ("run --quiet --dataset {clip} --weights siamrpnpp=absent.pth", "siamrpnpp"),
        ("run --tracker stil --dataset {clip}", "unknown tracker 'stil'; closest: still"),
        ("run --tracker still --enhancer gama --dataset {clip}", "unknown enhancer 'gama'"),
        ("run --tracker still --dataset nothing_here", "nothing_here"),
        (
            "run --tracker still --dataset {clip} --sequences wid",
            "no sequence 'wid'; closest: wide",
        ),
        (
            "run --tracker still --dataset {clip} --opt still.stp=1",
            "no option 'stp'; closest: step",
        ),
        ("run --tracker still --dataset {clip} --opt still=1", "expected NAME[@LABEL].KEY=VALUE"),
        ("run --tracker still --dataset {clip} --opt step", "expected KEY=VALUE"),
        ("run --tracker still --dataset {clip} --weights still=a.pth", "still takes no weights"),
        ("run --tracker siamapn --dataset {clip}", "no weights for siamapn: pass them with"),
        (
            "run --tracker siamrpnpp --dataset {clip} --weights siamrpnpp=absent.pth",
            "absent.pth: no such file",
        ),
        ("run --tracker opencv_nano --dataset {clip} --scope patch", "takes only scope=frame"),
        ("run --tracker still --dataset {clip} --device cuda:99", "torch sees"),
        ("eval --results absent", "absent: no such results folder"),
        ("eval --results {empty}", "holds no results"),
        ("eval --results {empty} --protocol pyso", "pyso"),
        ("eval --results {empty} --protocol-option labl=uav", "no option 'labl'; closest: label"),
        ("table --results {empty} --out a.csv", "--out needs --format"),
        ("dataset info absent", "absent"),
        ("dataset validate {empty}", "{empty}"),
        ("list --plugin absent.py", "absent.py cannot be loaded"),
    ],
)
def test_each_mistake_is_one_line_and_status_2(
    words: str, told: str, night_clip: Path, tmp_path: Path, cli: Any
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    places = {"clip": night_clip, "empty": empty}
    extra = ["--results", str(tmp_path / "r")] if words.startswith("run ") else []
    status, out, err = cli(*words.format(**places).split(), *extra)
    assert status == 2
    assert out == ""
    last = err.splitlines()[-1]
    assert told.format(**places) in last
    assert last.startswith("nat-bench: ")
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1


def test_help_keeps_its_lines_and_is_shown_without_a_verb(cli: Any) -> None:
    _, out, _ = cli("--help")
    assert "\\b" not in out
    assert "\n  nat-bench table --results results\n" in out
    assert cli() == (0, out, "")
    assert "synthesize" in cli("dataset")[1]


@pytest.mark.parametrize(
    "words",
    [
        "dataset synthesize {file}/x",
        "run --tracker still --dataset {clip} --results {file}/r",
        "run --tracker still --dataset {clip} --results {link}",
        "table --results {results} --format csv --out {file}/x.csv",
    ],
)
def test_what_cannot_be_written_is_one_line(
    words: str, night_clip: Path, results: Path, tmp_path: Path, cli: Any
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "at" / "all")
    places = {name: tmp_path / name for name in ("file", "link")}
    command = words.format(clip=night_clip, results=results, **places)
    status, _, err = cli(*command.split(), "--quiet")
    assert status == 2
    assert len(err.splitlines()) == 1
    assert "cannot be written" in err or "Not a directory" in err


def test_a_reader_that_goes_away_is_no_failure() -> None:
    import subprocess
    import sys

    command = f"{sys.executable} -m nat2024 list --json | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "0"
    assert done.stderr == ""


def test_words_in_brackets_are_no_markup(cli: Any, tmp_path: Path, small_plugins: str) -> None:
    folder = tmp_path / "[bold]"
    cli("dataset", "synthesize", folder, "--frames", 3, "--sequences", 1)
    status, out, _ = cli("run", "--tracker", "still", "--dataset", folder, "--results", tmp_path)
    assert status == 0
    assert "[bold]: 1 sequences, 3 frames" in out


def test_debug_shows_the_traceback(cli: Any, tmp_path: Path) -> None:
    status, _, err = cli("eval", "--results", tmp_path / "absent", "--debug")
    assert status == 2
    assert "Traceback" in err


def test_without_a_tracker_fdsst_runs(
    cli: Any, small_plugins: str, night_clip: Path, tmp_path: Path
) -> None:
    words = ("run", "--enhancer", "none", "--dataset", night_clip, "--results", tmp_path)
    status, out, err = cli(*words)
    assert status == 0
    assert "nat-bench: no --tracker given, taking fdsst" in err.splitlines()
    assert "fdsst" in out
    runs = [folder.name for folder in (tmp_path / "night_clip").iterdir() if folder.is_dir()]
    assert runs == ["fdsst"]
    status, _, err = cli(*words, "--tracker", "still")
    assert status == 0
    assert "no --tracker given" not in err


def test_without_a_dataset_the_sample_is_taken(
    cli: Any, small_plugins: str, tmp_path: Path
) -> None:
    results = tmp_path / "results"
    status, out, err = cli("run", "--tracker", "still", "--results", results)
    assert status == 0
    assert "no --dataset given, taking the sample night_mini" in err
    assert "6 sequences" in out
    assert len(list((results / "night_mini" / "still").glob("*.txt"))) == 6


def test_threads_wait_idly_unless_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_WAIT_POLICY", "")
    monkeypatch.delenv("OMP_WAIT_POLICY")
    for wanted in ("PASSIVE", "ACTIVE"):
        with pytest.raises(SystemExit):
            main(["--version"])
        assert os.environ["OMP_WAIT_POLICY"] == wanted
        monkeypatch.setenv("OMP_WAIT_POLICY", "ACTIVE")
