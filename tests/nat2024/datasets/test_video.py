"""Video files: the exact frame, an honest number of frames, one line for what is broken."""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from nat2024.datasets import load_dataset, read_reduced, validate
from nat2024.datasets import video as video_module
from nat2024.datasets.video import VideoFrames
from nat2024.errors import DatasetIncomplete, FrameUnreadable
from nat2024.keeping import cache_folder

COUNT = 70
KINDS = {"a.webm": "VP90", "a.avi": "MJPG", "a.mp4": "mp4v", "a.mkv": "VP90", "a.mov": "mp4v"}


def picture(number: int) -> np.ndarray:
    """48x32, its number in the upper half as eight black or white blocks, for any lossy codec."""
    image = np.full((32, 48, 3), 40, np.uint8)
    for bit in range(8):
        image[:16, 6 * bit : 6 * bit + 6] = 255 * (number >> bit & 1)
    image[20:28, 4 + number % 32 : 12 + number % 32] = (20, 90, 200)
    return image


def number_of(image: np.ndarray) -> int:
    return sum(int(image[4:12, 6 * bit + 2 : 6 * bit + 4].mean() > 127) << bit for bit in range(8))


def write_video(path: Path, codec: str, count: int = COUNT) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    code = cv2.VideoWriter_fourcc(*codec)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 25, (48, 32))
    assert writer.isOpened()
    for number in range(count):
        writer.write(picture(number))
    writer.release()
    return path


@pytest.fixture(scope="session")
def videos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("videos")
    for name, codec in KINDS.items():
        write_video(folder / name, codec)
    return folder


@pytest.fixture(params=sorted(KINDS))
def video(videos: Path, request: pytest.FixtureRequest) -> Path:
    return videos / request.param


def forward(path: Path) -> list[np.ndarray]:
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    images = []
    while True:
        ok, image = capture.read()
        if not ok:
            return images
        images.append(image)


def test_frames_in_order_are_what_the_decoder_gives(video: Path) -> None:
    frames = VideoFrames(video)
    assert len(frames) == COUNT
    assert frames.frame_size == (48, 32)
    for number, (image, expected) in enumerate(zip(frames, forward(video), strict=True)):
        assert number_of(image) == number
        assert image.dtype == np.uint8
        assert (image == expected).all()
    frames.close()


def test_random_access_gives_the_exact_frame(video: Path) -> None:
    expected, frames = forward(video), VideoFrames(video)
    order = np.random.default_rng(3).permutation(COUNT)
    for number in (*order, 0, COUNT - 1, -1, np.int64(5)):
        assert (frames[number] == expected[number]).all()
    with pytest.raises(IndexError):
        frames[COUNT]


@pytest.mark.parametrize("landing", ["early", "late", "elsewhere"])
def test_a_seek_that_lies_is_found_out(
    videos: Path, monkeypatch: pytest.MonkeyPatch, landing: str
) -> None:
    class Lying:
        """Seeks beside the frame that is asked for."""

        def __init__(self, *words: object) -> None:
            self.real = real(*words)

        def set(self, what: int, value: float) -> bool:
            off = {"early": -3, "late": 2, "elsewhere": -value}[landing]
            return self.real.set(what, max(0, value + off) if what == seek else value)

        def __getattr__(self, name: str) -> object:
            return getattr(self.real, name)

    real, seek = cv2.VideoCapture, cv2.CAP_PROP_POS_FRAMES
    monkeypatch.setattr(cv2, "VideoCapture", Lying)
    frames = VideoFrames(videos / "a.webm")
    for number in (60, 2, 66, 40):
        assert number_of(frames[number]) == number


def test_a_frame_with_the_right_time_but_other_pixels_is_decoded_from_the_start(
    videos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = videos / "a.mp4"
    expected, frames = forward(path), VideoFrames(path)
    opened: list[Path] = []
    real_open = video_module._open
    monkeypatch.setattr(video_module, "_open", lambda p: opened.append(p) or real_open(p))
    real_checksum, lies = video_module._checksum, [True]
    assert len(frames) == COUNT
    monkeypatch.setattr(
        video_module, "_checksum", lambda image: 0 if lies and lies.pop() else real_checksum(image)
    )
    assert (frames[50] == expected[50]).all()
    assert len(opened) == 3  # to count, to seek, and anew from the start


def test_times_that_do_not_tell_frames_apart_forbid_seeking(
    videos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video_module, "_time", lambda _: 0.0)
    frames = VideoFrames(videos / "a.webm")
    assert not frames.index.is_seekable
    assert [number_of(frames[number]) for number in (60, 3, 50)] == [60, 3, 50]


def test_frames_that_the_container_only_claims_do_not_count(tmp_path: Path, videos: Path) -> None:
    whole = (videos / "a.webm").read_bytes()
    cut = tmp_path / "cut.webm"
    cut.write_bytes(whole[: len(whole) * 6 // 10])
    capture = cv2.VideoCapture(str(cut))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == COUNT
    frames = VideoFrames(cut)
    assert 20 < len(frames) < COUNT
    assert frames.index.stated == COUNT
    assert number_of(frames[-1]) == len(frames) - 1
    (tmp_path / "cut.txt").write_text("1,2,3,4\n" * COUNT)
    with pytest.raises(
        DatasetIncomplete, match=r"70 boxes in .* but .. frames that can be decoded"
    ):
        load_dataset(cut)
    (tmp_path / "cut.txt").write_text("1,2,3,4\n" * len(frames))
    (note,) = validate(cut).notes
    assert note == f"cut: cut.webm states 70 frames, {len(frames)} can be decoded"


def test_rotation_in_the_metadata_is_ignored(tmp_path: Path, videos: Path) -> None:
    data = bytearray((videos / "a.mp4").read_bytes())
    at = data.index(b"tkhd") + 4 + 40  # version 0: the matrix of the track header
    quarter = [0, 0x10000, 0, -0x10000, 0, 0, 0, 0, 0x40000000]
    data[at : at + 36] = b"".join(v.to_bytes(4, "big", signed=True) for v in quarter)
    turned = tmp_path / "turned.mp4"
    turned.write_bytes(data)
    ok, image = cv2.VideoCapture(str(turned)).read()
    assert ok
    assert image.shape == (48, 32, 3)  # what OpenCV makes of it by itself
    frames = VideoFrames(turned)
    assert frames.frame_size == (48, 32)
    assert (frames[7] == forward(videos / "a.mp4")[7]).all()


def test_pickled_and_cut(videos: Path) -> None:
    frames = VideoFrames(videos / "a.avi")
    image = frames[9]
    again = pickle.loads(pickle.dumps(frames))
    assert again == frames
    assert hash(again) == hash(frames)
    assert again._index == frames.index  # not decoded anew
    assert (again[9] == image).all()
    shorter = frames.cut(10)
    assert len(shorter) == 10
    assert number_of(shorter[-1]) == 9
    assert shorter != frames


def test_files_are_closed_and_few_are_open_at_once(videos: Path) -> None:
    def handles() -> int:
        links = [os.path.realpath(link) for link in Path("/proc/self/fd").iterdir()]
        return sum(link.startswith(str(videos)) for link in links)

    if not Path("/proc/self/fd").is_dir():
        pytest.skip("needs /proc/self/fd")
    before = handles()
    sources = [VideoFrames(videos / name) for name in sorted(KINDS)] * 2
    kept = [VideoFrames(source.path) for source in sources]
    for source in kept:
        assert number_of(source[3]) == 3
    assert handles() <= video_module._OPEN_AT_ONCE
    for source in kept:
        assert number_of(source[4]) == 4
        source.close()
    assert handles() <= before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no video, it begins like no mp4"),
        (b"#EXTM3U\n#EXTINF:1\nfile:///etc/hostname\n", "no video, it begins like no mp4"),
        (b"\0\0\0\x18ftypisom" + bytes(300), "cannot be opened as a video"),
        (b"RIFF\0\0\0\0AVI " + bytes(300), "cannot be opened as a video"),
    ],
)
def test_what_is_no_video_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.mp4"
    path.write_bytes(content)
    with pytest.raises(FrameUnreadable, match=rf"x\.mp4: {message}"):
        len(VideoFrames(path))
    report = validate(tmp_path)
    (problem,) = report.problems
    assert problem.kind == "frame"
    assert problem.message.startswith("x: ")
    assert message in problem.message


def test_a_video_that_opencv_has_no_codec_for(
    videos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = cv2.VideoCapture

    class Blind:  # no subclass: OpenCV's types free instances of theirs wrongly
        def __init__(self, *arguments: object) -> None:
            self.capture = real(*arguments)

        def grab(self) -> bool:
            return False

        def __getattr__(self, name: str) -> object:
            return getattr(self.capture, name)

    monkeypatch.setattr(cv2, "VideoCapture", Blind)
    message = r"a\.mp4: not one frame .* lacks its codec \(FMP4\): write it anew as H\.264"
    with pytest.raises(FrameUnreadable, match=message):
        len(VideoFrames(videos / "a.mp4"))


def test_a_video_that_is_absent(tmp_path: Path) -> None:
    with pytest.raises(FrameUnreadable, match=r"gone\.mp4: cannot be read \(No such file"):
        VideoFrames(tmp_path / "gone.mp4").frame_size  # noqa: B018


def test_a_video_of_a_vast_size_is_refused_before_it_is_decoded(
    videos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nat2024.datasets.decoding.MAX_PIXELS", 48 * 32 - 1)
    with pytest.raises(FrameUnreadable, match="claims 48 x 32 pixels"):
        len(VideoFrames(videos / "a.webm"))


def test_the_published_layout_with_videos(tmp_path: Path, make: Callable[..., object]) -> None:
    write_video(tmp_path / "data_seq" / "nächte.webm", "VP90", 5)
    make.frames(tmp_path / "data_seq" / "b", 3)
    write_video(tmp_path / "data_seq" / "b.avi", "MJPG", 9)  # a preview: the frames go before
    (tmp_path / "data_seq" / "notes.pdf").write_bytes(b"stray")
    for name, count in (("nächte", 5), ("b", 3)):
        make.rows(tmp_path / "anno" / f"{name}.txt", count)
    dataset = load_dataset(tmp_path)
    assert [s.name for s in dataset] == ["b", "nächte"]
    assert [len(s) for s in dataset] == [3, 5]
    assert number_of(dataset["nächte"].image(4)) == 4
    assert validate(tmp_path).problems == ()


def test_a_folder_of_videos_and_a_single_video(tmp_path: Path, make: Callable[..., object]) -> None:
    for name in ("a.webm", "b.avi"):
        write_video(tmp_path / "clips" / name, KINDS[f"a.{name[2:]}"], 4)
        make.rows(tmp_path / "clips" / f"{name[0]}.txt", 4)
    dataset = load_dataset(tmp_path / "clips")
    assert [(s.name, len(s), len(s.boxes)) for s in dataset] == [("a", 4, 4), ("b", 4, 4)]
    single = load_dataset(tmp_path / "clips" / "b.avi")
    assert (single.name, [s.name for s in single]) == ("b", ["b"])
    write_video(tmp_path / "one" / "flight.webm", "VP90", 4)
    make.rows(tmp_path / "one" / "boxes.txt", 4)
    assert [len(s.boxes) for s in load_dataset(tmp_path / "one")] == [4]
    write_video(tmp_path / "each" / "x" / "v.webm", "VP90", 4)
    make.rows(tmp_path / "each" / "x" / "groundtruth.txt", 4)
    write_video(tmp_path / "each" / "other" / "talk.webm", "VP90", 4)
    assert [s.name for s in load_dataset(tmp_path / "each")] == ["x"]


def test_lenient_loading_cuts_to_the_shorter(tmp_path: Path, make: Callable[..., object]) -> None:
    write_video(tmp_path / "a.webm", "VP90", 6)
    make.rows(tmp_path / "a.txt", 4)
    with pytest.raises(DatasetIncomplete, match=r"4 boxes .* but 6 frames that can be decoded"):
        load_dataset(tmp_path / "a.webm")
    assert len(load_dataset(tmp_path / "a.webm", lenient=True)["a"]) == 4


def test_the_index_of_a_slow_video_is_stored(
    videos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NAT2024_CACHE", str(tmp_path / "cache"))
    assert cache_folder() == tmp_path / "cache"
    path = tmp_path / "a.webm"
    path.write_bytes((videos / "a.webm").read_bytes())
    first = VideoFrames(path).index
    assert not (tmp_path / "cache").exists()  # quick to make again
    monkeypatch.setattr("nat2024.datasets.video_index._WORTH_STORING_S", -1)
    assert VideoFrames(path).index == first
    (stored,) = (tmp_path / "cache" / "videos").iterdir()
    monkeypatch.setattr(video_module, "_decode_all", None)
    assert VideoFrames(path).index == first
    stored.write_text("{}")
    with pytest.raises(TypeError):  # a damaged file is made anew, which here it cannot be
        VideoFrames(path).index  # noqa: B018
    monkeypatch.undo()
    path.write_bytes((videos / "a.mkv").read_bytes()[:-2000])
    assert len(VideoFrames(path)) < COUNT


def test_reduced_frames_of_a_video(videos: Path) -> None:
    frames = VideoFrames(videos / "a.avi")
    small = read_reduced(frames, 3, 4)
    assert small.shape == (8, 12, 3)
    expected = frames[3].reshape(8, 4, 12, 4, 3).mean(axis=(1, 3))
    assert np.abs(small - expected).max() <= 1


def test_videos_are_listed_without_opencv_and_broken_ones_are_one_line(
    videos: Path, tmp_path: Path
) -> None:
    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x18ftypisom" + bytes(300))
    code = f"""
import sys
from pathlib import Path
from nat2024.datasets.layouts import find_layouts
find_layouts(Path({str(videos / "a.webm")!r}))
(layout,) = find_layouts(Path({str(tmp_path)!r}))
assert "cv2" not in sys.modules
try:
    len(layout.sequences[0].frames)
except Exception as error:
    print(error)
"""
    words = [sys.executable, "-c", code]
    run = subprocess.run(words, capture_output=True, text=True, check=True)
    assert run.stderr == ""
    assert run.stdout.endswith("a.mp4: cannot be opened as a video; get this file again\n")
