"""What several tests of importing share."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

BOXES = {
    "car1": np.array([[10.5, 20.5, 30, 40], [11.25, 21.5, 30, 40], [12.125, 22.5, 31, 41]]),
    "person_2": np.array([[5.5, 6.5, 7, 8], [6.5, 7.5, 7, 8]]),
}


def text(boxes: np.ndarray, separator: str = ",", form: str = "") -> str:
    return "".join(
        separator.join(format(v, form) if form else repr(v) for v in row) + "\n"
        for row in boxes.tolist()
    )


@pytest.fixture
def boxes() -> dict[str, np.ndarray]:
    return {name: rows.copy() for name, rows in BOXES.items()}


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str, str | bytes], Path]:
    """Writes one file under the test's folder."""

    def write(name: str, content: str | bytes) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture
def pack() -> Callable[[Path, Path], Path]:
    """Packs a folder into an archive."""

    def write(folder: Path, archive: Path) -> Path:
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            for path in sorted(p for p in folder.rglob("*") if p.is_file()):
                file.write(path, path.relative_to(folder).as_posix())
        return archive

    return write
