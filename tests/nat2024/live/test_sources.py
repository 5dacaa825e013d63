"""Folders, videos and streams as sources of frames."""

import http.server
import threading
import time

import cv2
import numpy as np
import pytest

from nat2024.errors import FrameUnreadable, UsageError
from nat2024.live import open_source


def frame(number):
    return np.full((48, 64, 3), 10 * number, np.uint8)


@pytest.fixture
def folder(tmp_path):
    for number in range(5):
        cv2.imwrite(str(tmp_path / f"{number}.png"), frame(number))
    return tmp_path


@pytest.fixture
def video(tmp_path):
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"MJPG"), 25, (64, 48)
    )
    for number in range(5):
        writer.write(frame(number))
    writer.release()
    return path


def numbers(source):
    found = []
    while (image := source.read()) is not None:
        found.append(round(float(image.mean()) / 10))
    return found


def test_a_folder(folder):
    with open_source(str(folder)) as source:
        assert (source.count, source.rate, source.is_live) == (5, 30.0, False)
        assert source.skip(1) == 1
        assert numbers(source) == [1, 2, 3, 4]
        assert source.take(3) == (0, None)


def test_a_video_with_its_rate(video):
    with open_source(str(video)) as source:
        assert source.rate == 25
        missed, image = source.take(2)
        assert missed == 2
        assert round(float(image.mean()) / 10) == 2
        assert source.take(7) == (2, None)
    with open_source(str(video), rate=5) as source:
        assert source.rate == 5
        assert numbers(source) == [0, 1, 2, 3, 4]


class Stream(http.server.BaseHTTPRequestHandler):
    """Motion JPEG, a frame every 20 ms."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        for number in range(20):
            data = cv2.imencode(".jpg", frame(number))[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            self.wfile.write(head.encode() + data + b"\r\n")
            time.sleep(0.02)
        self.wfile.write(b"--frame--\r\n")

    def log_message(self, *_):
        pass


@pytest.fixture
def stream():
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Stream)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/live.mjpg"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_stream_gives_its_newest_frame_and_tells_what_was_missed(stream):
    with open_source(stream) as source:
        assert source.is_live
        first = source.read()
        assert first.shape == (48, 64, 3)
        count = 1
        while True:
            missed, image = source.take(0)
            count += missed
            if image is None:
                break
            count += 1
            time.sleep(0.07)
        assert count == 20


def test_a_stream_can_be_left_early(stream):
    with open_source(stream) as source:
        source.read()
        source.take(0)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("nowhere", UsageError, "no such file or folder"),
        ("file:///etc/passwd", UsageError, "streams are read from"),
        ("http://127.0.0.1:9/nothing", FrameUnreadable, "cannot be opened as a stream"),
        ("63", FrameUnreadable, "camera 63 cannot be opened"),
    ],
)
def test_what_cannot_be_opened_is_one_line(text, error, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=words):
        open_source(text)


def test_no_images_and_no_video(tmp_path):
    with pytest.raises(UsageError, match="no images in it"):
        open_source(str(tmp_path))
    (tmp_path / "notes.txt").write_text("words")
    with pytest.raises(UsageError, match="no video by its name"):
        open_source(str(tmp_path / "notes.txt"))
    (tmp_path / "fake.mp4").write_text("words")
    with pytest.raises(FrameUnreadable, match="no video"):
        open_source(str(tmp_path / "fake.mp4"))
