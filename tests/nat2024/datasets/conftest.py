"""Tiny datasets in every layout, and nothing of the developer's own configuration."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest


class Make:
    """Writes tiny files; frames are 16x12."""

    def image(self, seed: int = 0, size: tuple[int, int] = (16, 12)) -> np.ndarray:
        shape = (size[1], size[0], 3)
        return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)

    def encoded(self, extension: str = ".jpg", seed: int = 0) -> bytes:
        return cv2.imencode(extension, self.image(seed))[1].tobytes()

    def frames(
        self,
        folder: Path,
        count: int,
        first: int = 1,
        digits: int = 5,
        data: bytes | None = None,
    ) -> None:
        """Images; with `data=b""` empty files, enough where only names are counted."""
        data = self.encoded() if data is None else data
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(first, first + count):
            (folder / f"{number:0{digits}d}.jpg").write_bytes(data)

    def rows(self, file: Path, rows: Iterable[Iterable[float]] | int) -> None:
        """Rows as given, or so many of the box 1,2,3,4."""
        file.parent.mkdir(parents=True, exist_ok=True)
        rows = [(1, 2, 3, 4)] * rows if isinstance(rows, int) else rows
        file.write_text("".join(",".join(f"{v:g}" for v in row) + "\n" for row in rows))

    def apart(
        self,
        root: Path,
        lengths: dict[str, int],
        frames: str = "data_seq",
        boxes: str | None = "anno",
        data: bytes | None = None,
    ) -> Path:
        """`FRAMES/NAME/00001.jpg` and `BOXES/NAME.txt`."""
        for name, count in lengths.items():
            self.frames(root / frames / name, count, data=data)
            if boxes:
                self.rows(root / boxes / f"{name}.txt", count)
        return root

    def published(self, root: Path, name: str, sequences: Iterable[str]) -> Path:
        """Some sequences of a registered dataset: names, lengths and first boxes; empty files."""
        from nat2024.datasets import registered_dataset

        facts = registered_dataset(name)
        for sequence in sequences:
            known = facts.sequences[sequence]
            folder = root / "data_seq" / sequence
            self.frames(folder, known.frames, known.first_frame, facts.frame_digits or 6, b"")
            first = known.first_box or (1, 2, 3, 4)
            self.rows(
                root / "anno" / f"{sequence}.txt", [first, *[(1, 2, 3, 4)] * (known.frames - 1)]
            )
        return root


@pytest.fixture(scope="session")
def make() -> Make:
    return Make()


@pytest.fixture(autouse=True)
def no_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in list(os.environ):
        if variable.startswith("NAT2024_"):
            monkeypatch.delenv(variable)
    monkeypatch.setattr("platformdirs.user_config_path", lambda name: tmp_path / "none" / name)


@pytest.fixture
def log_lines(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    caplog.set_level("INFO", logger="nat2024")
    return lambda: [r.getMessage() for r in caplog.records if r.name == "nat2024"]
