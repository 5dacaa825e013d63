import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import nat2024
from nat2024.enhancing import (
    Enhanced,
    Observation,
    compute_maps,
    create_enhancers,
    enhance_images,
    find_source,
)
from nat2024.enhancing.feeding import enhance
from nat2024.errors import ResultConflict, UnknownPlugin, UsageError
from nat2024.files import temporary_beside
from nat2024.registry import load_plugin
from nat2024_reports.figures.enhancement import maps_figure


def files(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_names_are_kept_and_pixels_are_those_of_the_enhancer(
    folder: Path, tmp_path: Path, image: np.ndarray
) -> None:
    out = tmp_path / "out"
    before = files(folder)
    report = enhance_images(folder, ["none", "clahe"], out)
    assert files(out / "clahe") == ["a.JPG", "b.png", "sub/c.bmp"]
    assert files(folder) == before
    expected = nat2024.create_enhancer("clahe").enhance(image, bgr=True)
    np.testing.assert_array_equal(cv2.imread(str(out / "clahe" / "b.png")), expected)
    np.testing.assert_array_equal(cv2.imread(str(out / "none" / "b.png")), image)
    assert report.images == 3
    assert report.failures == ()
    assert report.enhancers[1] == Enhanced("clahe", str(out / "clahe"), 3, 0, 0)


def test_a_second_run_makes_only_what_is_missing(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    enhance_images(folder, ["gamma"], out)
    (out / "gamma" / "a.JPG").unlink()
    kept = (out / "gamma" / "b.png").stat().st_mtime_ns
    (one,) = enhance_images(folder, ["gamma"], out).enhancers
    assert (one.written, one.finished_before) == (1, 2)
    assert (out / "gamma" / "b.png").stat().st_mtime_ns == kept


def test_a_folder_from_before_an_option_existed_goes_on(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    enhance_images(folder, ["gamma"], out)
    record = out / "gamma.json"
    text = record.read_text()
    assert '"gamma": 0.5' in text
    record.write_text(text.replace('"gamma": 0.5', ""))
    (one,) = enhance_images(folder, ["gamma"], out).enhancers
    assert one.finished_before == 3
    with pytest.raises(ResultConflict, match=r"gamma\.gamma unset \(now 0\.3\)"):
        enhance_images(folder, ["gamma"], out, options={"gamma": {"gamma": 0.3}})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"options": {"gamma": {"gamma": 0.3}}}, "gamma.gamma 0.5 .now 0.3"),
        ({"quality": 80}, "quality 95"),
        ({"feed": "tracker"}, "feed image"),
    ],
)
def test_other_settings_are_refused(
    folder: Path, tmp_path: Path, change: dict[str, Any], told: str
) -> None:
    out = tmp_path / "out"
    enhance_images(folder, ["gamma"], out)
    with pytest.raises(ResultConflict, match=told):
        enhance_images(folder, ["gamma"], out, **change)
    assert len(enhance_images(folder, ["gamma"], out).failures) == 0


def test_another_input_and_foreign_files_are_refused(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    enhance_images(folder, ["gamma"], out)
    with pytest.raises(ResultConflict, match="input"):
        enhance_images(folder / "sub", ["gamma"], out)
    (out / "none").mkdir()
    (out / "none" / "x.png").write_bytes(b"")
    with pytest.raises(ResultConflict, match="lies beside it"):
        enhance_images(folder, ["none"], out)


def test_a_broken_image_costs_only_itself(folder: Path, tmp_path: Path) -> None:
    (folder / "broken.png").write_bytes(b"no image")
    report = enhance_images(folder, ["none", "gamma"], tmp_path / "out")
    assert [(f.enhancer, f.image) for f in report.failures] == [
        ("none", "broken.png"),
        ("gamma", "broken.png"),
    ]
    assert [one.written for one in report.enhancers] == [3, 3]
    assert [one.failed for one in report.enhancers] == [1, 1]


def test_a_plugin_may_fail_in_any_way(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from nat2024_enhancers.gamma import Gamma

    shapes: list[Any] = []

    def fail(self: Any, image: Any, *, bgr: bool = False) -> Any:
        shapes.append(image.shape)
        if len(shapes) == 1:
            raise ZeroDivisionError("lost")
        return image[:1] if len(shapes) == 2 else image

    monkeypatch.setattr(Gamma, "enhance", fail)
    report = enhance_images(folder, ["gamma"], tmp_path / "out")
    first, second = (failure.reason for failure in report.failures)
    assert first == "ZeroDivisionError: lost"
    assert "turned an image of (60, 90, 3) into (1, 90, 3)" in second
    assert files(tmp_path / "out" / "gamma") == ["sub/c.bmp"]


def test_nothing_is_written_into_the_input_or_out_of_the_output(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    for place in (folder, folder / "sub", folder / "new"):
        with pytest.raises(UsageError, match="lies in the input"):
            enhance_images(folder, ["gamma"], place)
    out.mkdir()
    shutil.copytree(folder, out / "gamma")
    with pytest.raises(UsageError, match="to be written"):
        enhance_images(out / "gamma", ["gamma"], out)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (out / "clahe").symlink_to(elsewhere)
    with pytest.raises(UsageError, match="is a link out of"):
        enhance_images(folder, ["clahe"], out)
    assert list(elsewhere.iterdir()) == []


def test_a_link_among_the_images_is_not_followed(folder: Path, tmp_path: Path) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    enhance_images(find_source(folder, limit=1), ["none"], out)
    (out / "none" / "sub").symlink_to(elsewhere)
    with pytest.raises(UsageError, match="is a link out of"):
        enhance_images(folder, ["none"], out)
    assert list(elsewhere.iterdir()) == []


def test_what_cannot_run_is_refused_before_anything_is_written(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    with pytest.raises(UnknownPlugin):
        enhance_images(folder, ["gamma", "nope"], out)
    with pytest.raises(UsageError, match="at least one"):
        enhance_images(folder, [], out)
    with pytest.raises(UsageError, match="named twice"):
        enhance_images(folder, ["gamma", "gamma"], out)
    with pytest.raises(UsageError, match="not run"):
        enhance_images(folder, ["gamma"], out, weights={"clahe": "x"})
    with pytest.raises(UsageError, match="quality"):
        enhance_images(folder, ["gamma"], out, quality=0)
    assert not out.exists()


def test_an_observer_sees_every_image_also_those_made_before(
    folder: Path, tmp_path: Path, image: np.ndarray
) -> None:
    seen: list[Observation] = []
    enhance_images(folder, ["gamma"], tmp_path / "out")
    report = enhance_images(folder, ["gamma"], tmp_path / "out", observer=seen.append)
    assert report.enhancers[0].finished_before == 3
    assert [one.name for one in seen] == ["a.JPG", "b.png", "sub/c.bmp"]
    np.testing.assert_array_equal(seen[1].before, image)
    exact = seen[1].unrounded()
    assert exact.shape == image.shape
    np.testing.assert_allclose(exact, np.sqrt(image / 255), atol=1e-5)
    np.testing.assert_array_equal(seen[1].after, np.round(exact * 255).astype(np.uint8))


def test_feed_decides_the_order_of_colours(small_plugins: str, image: np.ndarray) -> None:
    clahe = nat2024.create_enhancer("clahe")
    np.testing.assert_array_equal(enhance(clahe, image, "image"), clahe.enhance(image, bgr=True))
    np.testing.assert_array_equal(enhance(clahe, image, "tracker"), clahe.enhance(image))


def test_maps_are_cut_to_the_image_in_the_order_that_the_network_saw() -> None:
    enhancer = nat2024.create_enhancer("ldenhancer", weights=False)  # type: ignore[arg-type]
    image = np.random.default_rng(0).integers(0, 99, (20, 37, 3), dtype=np.uint8)
    maps, order = compute_maps(enhancer, image, "image")
    assert order == "RGB"
    assert maps["P_S"].shape == (12, 20, 37)
    assert maps["O2"].shape == (3, 20, 37)
    assert maps["F0"].shape == (8, 2, 3)
    swapped, order = compute_maps(enhancer, np.ascontiguousarray(image[..., ::-1]), "tracker")
    assert order == "BGR"
    np.testing.assert_array_equal(maps["A"], swapped["A"])


@pytest.mark.parametrize("name", nat2024.list_enhancers())
def test_maps_of_every_enhancer_can_be_drawn(name: str, image: np.ndarray) -> None:
    fresh = {"weights": False} if load_plugin(name, "enhancer").card.needs_weights else {}
    maps, order = compute_maps(nat2024.create_enhancer(name, **fresh), image, "image")
    for values in maps.values():
        assert values.ndim == 3
        assert maps_figure("a map", values, order).axes


def test_enhancers_can_be_had_by_title() -> None:
    made = create_enhancers(["gamma", "gamma@b"], options={"gamma@b": {"gamma": "0.3"}})
    assert [one.gamma for one in made.values()] == [0.5, 0.3]  # type: ignore[attr-defined]


def test_a_video_becomes_a_video(tmp_path: Path, video: Callable[..., Path]) -> None:
    out = tmp_path / "out"
    report = enhance_images(video(tmp_path / "v.avi"), ["gamma"], out)
    assert report.enhancers[0].written == 7
    assert files(out) == ["gamma.json", "gamma/v.webm"]
    capture = cv2.VideoCapture(str(out / "gamma" / "v.webm"))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(10)
    means = []
    while (read := capture.read())[0]:
        means.append(read[1].mean())
    (item,) = find_source(tmp_path / "v.avi").items
    given = np.array([item.read(index).image.mean() for index in range(7)])
    np.testing.assert_allclose(means, 255 * np.sqrt(given / 255), atol=4)  # 8-bit YCbCr of a video
    again = enhance_images(tmp_path / "v.avi", ["gamma"], out)
    assert again.enhancers[0].finished_before == 7
    with pytest.raises(ResultConflict, match="video every 1"):
        enhance_images(find_source(tmp_path / "v.avi", every=2), ["gamma"], out)


def test_frames_are_written_where_asked_or_where_a_side_is_odd(
    tmp_path: Path, video: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = video(tmp_path / "v.avi")
    enhance_images(given, ["none"], tmp_path / "a", frames_only=True)
    assert files(tmp_path / "a" / "none") == [f"v/{n:06d}.png" for n in range(1, 8)]
    monkeypatch.setattr("nat2024.enhancing.running.can_be_video", lambda *_: False)
    enhance_images(given, ["none"], tmp_path / "b")
    assert len(files(tmp_path / "b" / "none")) == 7
    assert enhance_images(given, ["none"], tmp_path / "b").enhancers[0].finished_before == 7


def test_a_video_that_breaks_leaves_nothing_half_written(
    tmp_path: Path, video: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from nat2024_enhancers.gamma import Gamma

    calls: list[int] = []
    whole = Gamma.enhance

    def stop(self: Any, image: Any, *, bgr: bool = False) -> Any:
        calls.append(1)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return whole(self, image, bgr=bgr)

    given, out = video(tmp_path / "v.avi"), tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr(Gamma, "enhance", stop)
        with pytest.raises(KeyboardInterrupt):
            enhance_images(given, ["gamma"], out)
    assert files(out) == ["gamma.json"]
    begun = temporary_beside(out / "gamma" / "v.webm", ".webm").name
    dead = begun.replace(f"-{os.getpid()}-", "-999999999-")
    (out / "gamma" / dead).write_bytes(b"of a killed process")
    assert enhance_images(given, ["gamma"], out).enhancers[0].written == 7
    assert files(out) == ["gamma.json", "gamma/v.webm"]


def test_no_video_is_told(tmp_path: Path) -> None:
    (tmp_path / "v.mp4").write_bytes(b"none")
    report = enhance_images(tmp_path / "v.mp4", ["none"], tmp_path / "out")
    assert "no video" in report.failures[0].reason
