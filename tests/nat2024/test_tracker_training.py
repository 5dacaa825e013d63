from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

import nat2024
from nat2024.cli import run
from nat2024.errors import (
    DatasetIncomplete,
    DatasetNotFound,
    FrameUnreadable,
    InvalidOption,
    ResultConflict,
    UsageError,
)
from nat2024.tracker_training import (
    TrackerTraining,
    choose_settings,
    read_clips,
    read_photographs,
    train_tracker,
)

SMALL = {"batch_size": 2, "search": 143, "shift": 8, "warm_up": 0, "checked": 4}


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photographs")
    rng = np.random.default_rng(3)
    for number in range(2):
        coarse = rng.integers(0, 256, size=(8, 10, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{number}.png"), np.kron(coarse, np.ones((16, 16, 1), np.uint8)))
    return folder


def training(out: Path, photographs: Path, clip: Path, **values: Any) -> TrackerTraining:
    loop, own = choose_settings("siamrpnpp", "default", {**SMALL, "validate_every": 99, **values})
    return TrackerTraining(
        "siamrpnpp", out, photographs, str(clip), options={"variant": "compact"}, loop=loop, own=own
    )


def test_a_training_resumes_and_gives_usable_weights(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    """Stopped after half, it ends with the same bits as without a stop."""
    values = {"steps": 8, "checkpoint_every": 4, "log_every": 1, "learning_rate": 1e-3}
    whole = train_tracker(training(tmp_path / "whole", photographs, night_clip, **values))
    assert (whole.photographs, whole.clips) == (2, 3)
    assert set(whole.training.terms) >= {"positive", "negative", "cross", "box", "loss"}
    assert {"procedural_slope", "clips_overlap"} <= set(whole.training.numbers)
    half = training(tmp_path / "half", photographs, night_clip, **values)
    assert train_tracker(half, minutes=0).training.steps == 0
    name = "checkpoints/step-00000004.pt"  # as if killed after step 4
    (tmp_path / "half" / name).parent.mkdir(exist_ok=True)
    (tmp_path / "half" / name).write_bytes((tmp_path / "whole" / name).read_bytes())
    resumed = train_tracker(half)
    assert resumed.training.resumed_from == 4
    first, second = (
        nat2024.create_tracker("siamrpnpp", variant="compact", weights=report.weights).model  # type: ignore[attr-defined]
        for report in (whole, resumed)
    )
    for key, value in first.state_dict().items():
        assert torch.equal(value, second.state_dict()[key]), key


def test_another_configuration_does_not_go_on(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    values = {"steps": 1, "procedural": 1.0}
    one = training(tmp_path, photographs, night_clip, **values)
    train_tracker(one)
    other = replace(one, sequences="", loop=msgspec_replace(one.loop, steps=2))
    with pytest.raises(ResultConflict, match="clips 3 there, 0 now"):
        train_tracker(other)


def msgspec_replace(record: Any, **values: Any) -> Any:
    import msgspec

    return msgspec.structs.replace(record, **values)


def test_the_seed_decides_fresh_weights_and_nothing_else(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    """Two trainings of one seed end alike, whatever was drawn before; torch's numbers stay."""
    found = []
    for number, seed in enumerate((3, 3, 4)):
        torch.manual_seed(number)
        one = training(tmp_path / str(number), photographs, night_clip, steps=1, seed=seed)
        found.append(train_tracker(one).weights.read_bytes())
        after = torch.rand(1)
        torch.manual_seed(number)
        assert torch.equal(after, torch.rand(1))
    assert found[0] == found[1]
    assert found[0] != found[2]


def test_the_number_of_steps_is_told_and_wrong_names_before_them(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    totals: list[int] = []
    one = training(tmp_path, photographs, night_clip, epochs=3)
    train_tracker(one, minutes=0, on_total=totals.append)
    assert totals == [750]
    wrong = replace(one, loop=msgspec_replace(one.loop, best="clips_overlp"))
    with pytest.raises(InvalidOption, match="no number 'clips_overlp'; closest: clips_overlap"):
        train_tracker(wrong, minutes=0)


def test_a_start_from_other_weights_does_not_go_on(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    """The content of the file counts, not its name."""
    first = train_tracker(training(tmp_path / "a", photographs, night_clip, steps=1)).weights
    start = tmp_path / "start.safetensors"
    start.write_bytes(first.read_bytes())
    one = replace(training(tmp_path / "b", photographs, night_clip, steps=1), start=start)
    train_tracker(one)
    moved = start.rename(tmp_path / "moved.safetensors")
    assert train_tracker(replace(one, start=moved)).training.resumed_from == 1
    other = train_tracker(training(tmp_path / "c", photographs, night_clip, steps=1, seed=2))
    with pytest.raises(ResultConflict, match="start"):
        train_tracker(replace(one, start=other.weights))


def test_settings_of_loop_and_pairs_are_set_by_name() -> None:
    loop, own = choose_settings("siamrpnpp", "default", {"steps": "12", "scale": "0.3"})
    assert (loop.steps, loop.batch_size, own.scale) == (12, 8, 0.3)
    with pytest.raises(InvalidOption, match="no setting 'scal'; closest: scale"):
        choose_settings("siamrpnpp", "default", {"scal": 1})
    with pytest.raises(InvalidOption, match="no training preset 'best'"):
        choose_settings("siamrpnpp", "best", {})
    with pytest.raises(UsageError, match="mil cannot be trained"):
        choose_settings("mil", "default", {})


def test_variants_with_heads_of_several_levels_are_refused(
    tmp_path: Path, photographs: Path, night_clip: Path
) -> None:
    one = replace(training(tmp_path, photographs, night_clip), options={"variant": "mobilev2"})
    with pytest.raises(UsageError, match="mobilev2 cannot be trained"):
        train_tracker(one)


def test_bad_material_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="name photographs, or sequences"):
        train_tracker(TrackerTraining("siamrpnpp", tmp_path))
    with pytest.raises(DatasetNotFound, match="no such folder"):
        read_photographs(tmp_path / "absent")
    with pytest.raises(DatasetIncomplete, match="no image in it"):
        read_photographs(tmp_path)
    (tmp_path / "a.jpg").write_bytes(b"no image")
    with pytest.raises(FrameUnreadable, match=r"a\.jpg: no JPEG, PNG or BMP image"):
        read_photographs(tmp_path)
    whole = cv2.imencode(".jpg", np.full((64, 64, 3), 90, np.uint8))[1].tobytes()
    (tmp_path / "a.jpg").write_bytes(whole[:-200])  # which OpenCV would fill with grey
    with pytest.raises(FrameUnreadable, match=r"a\.jpg: truncated"):
        read_photographs(tmp_path)
    (tmp_path / "a.jpg").write_bytes(whole)
    assert [one.shape for one in read_photographs(tmp_path)] == [(64, 64, 3)]


def test_clips_are_the_annotated_sequences(night_clip: Path) -> None:
    clips = read_clips(str(night_clip))
    assert len(clips) == 3
    frames, boxes = clips[0]
    assert boxes.shape == (8, 4)
    assert frames[7].shape == (96, 160, 3)


def test_the_verb_trains_a_tracker_and_prints_its_checks(
    tmp_path: Path, photographs: Path, night_clip: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["train", "siamrpnpp", "--data", str(night_clip), "--photographs", str(photographs)]
    values = [f"--set={key}={value}" for key, value in SMALL.items()]
    status = run([*words, *values, "--steps", "2", "--out", str(tmp_path)])
    out = capsys.readouterr().out
    assert status == 0
    assert "2 of 2 steps on 2 photographs and 3 sequences" in out
    assert "slope" in out
    assert "composite" in out
    weights = tmp_path / "siamrpnpp.safetensors"
    assert nat2024.create_tracker("siamrpnpp", variant="compact", weights=weights)
    assert run(["train", "siamrpnpp", "--data", str(photographs), "--settings", "--json"]) == 0
    assert '"procedural": 0.36' in capsys.readouterr().out
    both = ["--data", str(photographs), "--photographs", str(photographs)]
    assert run(["train", "siamrpnpp", *both]) == 2
    assert "has no boxes" in capsys.readouterr().err


def test_words_that_do_not_fit_are_one_line(
    tmp_path: Path, photographs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path)]
    cases = {
        ("siamrpnpp",): "--data is missing: a dataset with boxes, or a folder of photographs",
        ("siamrpnpp", "--ablation", "--cache", "x"): "is a tracker; --cache, --ablation are for tr",
        ("dcepp", "--photographs", str(photographs)): "an enhancer; --photographs is for training",
    }
    for words, message in cases.items():
        assert run(["train", *words, *out]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1


def test_photographs_alone_will_do(
    tmp_path: Path, photographs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["train", "siamrpnpp", "--photographs", str(photographs), "--steps", "1"]
    values = [f"--set={key}={value}" for key, value in SMALL.items()]
    assert run([*words, *values, "--out", str(tmp_path)]) == 0
    assert "1 of 1 steps on 2 photographs and 0 sequences" in capsys.readouterr().out
