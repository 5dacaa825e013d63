"""Render the bundled sample `night_mini` again.

    python scripts/make_night_mini.py

writes `nat2024/datasets/samples/night_mini.zip` and its facts, `nat2024/datasets/facts/
night_mini.json`. On one machine the bytes are the same every time; between machines a grey level
may differ by one before JPEG.
"""

import json
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from nat2024 import read_boxes
from nat2024.night.sample import QUALITY, SAMPLE
from nat2024.night.sequence import ATTRIBUTES
from nat2024.synthesis import Synthesized, synthesize

DATASETS = Path(__file__).resolve().parents[1] / "nat2024" / "datasets"
_DATE = (2024, 10, 14, 0, 0, 0)
_LEFT_OUT = {"nat-bench.json"}  # the facts say it


def main() -> None:
    """Render, pack, and write the facts."""
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "night_mini"
        made = synthesize(base, SAMPLE, quality=QUALITY)
        pack(base, DATASETS / "samples" / "night_mini.zip")
        facts = facts_of(base, made)
    text = json.dumps(facts, indent=2) + "\n"
    (DATASETS / "facts" / "night_mini.json").write_text(text, encoding="utf-8")


def pack(base: Path, archive: Path) -> None:
    """Put a folder into an archive whose bytes depend on the files alone."""
    archive.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(archive, "w") as target:
        for path in sorted(p for p in base.rglob("*") if p.is_file() and p.name not in _LEFT_OUT):
            kind = zipfile.ZIP_STORED if path.suffix == ".jpg" else zipfile.ZIP_DEFLATED
            entry = zipfile.ZipInfo(path.relative_to(base).as_posix(), _DATE)
            entry.compress_type = kind
            target.writestr(entry, path.read_bytes())


def facts_of(base: Path, made: tuple[Synthesized, ...]) -> dict[str, object]:
    """What `nat2024.datasets` tells about the sample."""
    sequences = {}
    for one in sorted(made, key=lambda s: s.name):
        first = np.round(read_boxes(base / "anno" / f"{one.name}.txt")[0], 4).tolist()
        sequences[one.name] = {"frames": one.frames, "first_box": first}
    return {
        "title": "night_mini",
        "paper": "nat-bench, docs/night-renderer.md",
        "licence": "Apache-2.0",
        "obtain": "it comes with nat-bench",
        "expected_layout": "data_seq/NAME/*.jpg with anno/NAME.txt and att/NAME.txt",
        "folders": ["night_mini"],
        "attribute_columns": list(ATTRIBUTES),
        "attribute_note": "known from how the sequences are rendered",
        "resolution": list(SAMPLE[0].size),
        "frame_rate": 30.0,
        "frame_digits": 5,
        "source": "scripts/make_night_mini.py writes this file and the sample itself",
        "sequences": sequences,
    }


if __name__ == "__main__":
    main()
