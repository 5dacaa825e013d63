"""Which backend a run takes, what the manifest says of it, and how a begun run goes on."""

from pathlib import Path

import msgspec
import pytest

from nat2024 import load_dataset
from nat2024.backends import OPENVINO_FIRST, is_installed, runtimes
from nat2024.engine import combine, merge_results, run_benchmark
from nat2024.errors import ResultConflict, UsageError
from nat2024.store import RunFolder
from nat2024_trackers.siamese.tracker import SiameseTracker

needs_openvino = pytest.mark.skipif(
    not is_installed("openvino", "cpu"), reason="OpenVINO is not installed"
)


@pytest.fixture
def openvino_is_fastest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SiameseTracker, "fastest_backends", OPENVINO_FIRST)


def run(
    clip: Path, results: Path, backend: str, sequence: str = "narrow", **options: str
) -> RunFolder:
    [combination] = combine(
        ["siamrpnpp"], ["gamma"], backend=backend, options={"siamrpnpp": options} if options else {}
    )
    dataset = load_dataset(clip).select([sequence])
    report = run_benchmark([combination], dataset, results)
    assert not report.failures
    return RunFolder(report.folder / combination.run)


def test_only_networks_get_a_backend() -> None:
    [combination] = combine(["siamrpnpp"], ["gamma"], backend="auto", precision="float32")
    assert combination.tracker.options["backend"] == "auto"
    assert combination.enhancer is not None
    assert "backend" not in combination.enhancer.options


def test_an_option_of_ones_own_comes_first() -> None:
    [combination] = combine(
        ["siamrpnpp"], ["none"], backend="auto", options={"siamrpnpp": {"backend": "torch"}}
    )
    assert combination.tracker.options["backend"] == "torch"


def test_a_backend_that_is_not_there() -> None:
    with pytest.raises(UsageError, match="tensorrt is not installed for device cpu"):
        combine(["siamrpnpp"], ["none"], backend="tensorrt")


@needs_openvino
@pytest.mark.usefixtures("openvino_is_fastest")
def test_the_manifest_says_what_auto_was_and_a_begun_run_keeps_it(
    night_clip: Path, tmp_path: Path
) -> None:
    folder = run(night_clip, tmp_path / "auto", "auto")
    manifest = folder.manifest()
    assert manifest is not None
    assert manifest.tracker.options["backend"] == "openvino"
    plain = run(night_clip, tmp_path / "torch", "torch")
    begun = run(night_clip, tmp_path / "torch", "auto", "wide").manifest()
    assert begun is not None
    assert begun.tracker.options["backend"] == "torch"
    assert plain.finished() == ["narrow", "wide"]
    with pytest.raises(ResultConflict, match=r"siamrpnpp.backend torch \(now openvino\)"):
        run(night_clip, tmp_path / "torch", "openvino", "tall")
    away = abs(folder.boxes("narrow") - plain.boxes("narrow"))
    assert away.max() < 1e-3


@needs_openvino
@pytest.mark.usefixtures("openvino_is_fastest")
def test_a_begun_run_goes_on_with_what_took_over(
    night_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> object:
        msg = "broken here"
        raise RuntimeError(msg)

    with monkeypatch.context() as patch:
        patch.setattr(runtimes, "_open_openvino", refuse)
        run(night_clip, tmp_path / "results", "auto")
    again = run(night_clip, tmp_path / "results", "auto", "wide")
    assert again.finished() == ["narrow", "wide"]
    manifest = again.manifest()
    assert manifest is not None
    assert manifest.tracker.options["backend"] == "openvino"
    took_over = "onnxruntime" if is_installed("onnxruntime", "cpu") else "torch"
    assert manifest.other_backends == {"narrow": {"siamrpnpp": [took_over]}}
    assert [p.name for p in again.path.glob("backends/*")] == ["narrow.json"]
    merge_results([tmp_path / "results"], tmp_path / "merged")
    merged = RunFolder(tmp_path / "merged" / "night_clip" / "siamrpnpp+gamma").manifest()
    assert merged is not None
    assert merged.other_backends == manifest.other_backends


def test_a_device_that_is_none_is_named(night_clip: Path, tmp_path: Path) -> None:
    combinations = combine(["siamrpnpp"], ["none"], device="mps", backend="auto")
    with pytest.raises(UsageError, match="device 'mps' is none of cpu, cuda, cuda:N"):
        run_benchmark(combinations, load_dataset(night_clip), tmp_path / "results")


def test_a_run_from_before_backends_goes_on_in_torch(night_clip: Path, tmp_path: Path) -> None:
    folder = run(night_clip, tmp_path / "results", "torch")
    manifest = folder.manifest()
    assert manifest is not None
    for key in ("backend", "precision"):
        del manifest.tracker.options[key]
    folder.write_manifest(msgspec.convert(msgspec.to_builtins(manifest), type(manifest)))
    again = run(night_clip, tmp_path / "results", "auto", "wide")
    assert again.finished() == ["narrow", "wide"]
