"""Writing MP4 videos (H.264) with the FFmpeg that the extra `video` brings."""

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import Any

from nat2024.errors import Unwritable
from nat2024.files import remove_leftovers, temporary_beside
from nat2024.types import Image

MP4_ENDING = ".mp4"


class Mp4File:
    """A video that is there only when it is whole, as `VideoFile`, but H.264 in MP4."""

    def __init__(self, path: Path, size: tuple[int, int], rate: float) -> None:
        """Keep what is to be written.

        Args:
            path: of the video, ending in `MP4_ENDING`.
            size: (width, height), both even.
            rate: frames a second.
        """
        self._path, self._size, self._rate = path, size, rate
        self._begun = temporary_beside(path, MP4_ENDING)  # FFmpeg goes by the ending
        self._writer: Generator[None, bytes, None] | None = None

    def __enter__(self) -> "Mp4File":
        """Begin.

        Raises:
            Unwritable: the extra is missing, or the file system refuses.
        """
        ffmpeg = _ffmpeg(self._path)
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            remove_leftovers(self._path.parent)
            self._begun.touch()
        except OSError as error:
            msg = f"{self._path}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None
        self._writer = ffmpeg.write_frames(
            str(self._begun),
            self._size,
            pix_fmt_in="bgr24",
            fps=self._rate,
            codec="libx264",
            quality=None,
            macro_block_size=2,
            output_params=["-crf", "20", "-preset", "veryfast", "-movflags", "+faststart"],
            ffmpeg_log_level="error",
        )
        self._writer.send(None)  # type: ignore[arg-type] # starts the generator
        return self

    def write(self, image: Image) -> None:
        """Append a frame, uint8 (H, W, 3) BGR of the size given.

        Raises:
            Unwritable: FFmpeg has ended, as where the disk is full.
        """
        assert self._writer is not None
        try:
            self._writer.send(image.tobytes())
        except OSError as error:
            msg = f"{self._path}: FFmpeg cannot write it ({str(error).splitlines()[0]})"
            raise Unwritable(msg) from None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Put the whole video at its place, or remove what was begun."""
        if self._writer is not None:
            with contextlib.suppress(OSError):
                self._writer.close()
        if kind is not None:
            self._begun.unlink(missing_ok=True)
            return
        try:
            self._begun.replace(self._path)
        except OSError as error:
            msg = f"{self._path}: cannot be written ({error.strerror or error})"
            raise Unwritable(msg) from None


def _ffmpeg(path: Path) -> Any:
    try:
        import imageio_ffmpeg  # type: ignore[import-untyped]

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        msg = f'{path}: MP4 needs FFmpeg; pip install "nat-bench[video]", or write WebM'
        raise Unwritable(msg) from None
    return imageio_ffmpeg
