"""Writes compact_golden.json from the implementation; run only when it is meant to change.

python tests/data/make_compact.py
"""

import json
import sys
from pathlib import Path

import torch

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "trackers"))

from conftest import make_clip, make_procedural_state, make_recipe  # noqa: E402

from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN  # noqa: E402
from nat2024_trackers.siamrpnpp.plugin import SiamRPNpp  # noqa: E402


def main() -> None:
    """Track the generated clip with procedural weights."""
    with torch.device("meta"):
        network = CompactSiamRPN()
    special = {f"rpn_head.{name}.head.3.weight": {"scale": 0.2} for name in ("cls", "loc")}
    tracker = SiamRPNpp(weights=False, variant="compact")
    tracker.model.load_state_dict(make_procedural_state(make_recipe(network, "compact", special)))
    frames, box = make_clip()
    tracker.init(frames[0], box)
    rows = []
    for frame in frames[1:4]:
        row, score = tracker.update(frame)
        assert tracker.last_step is not None
        rows.append([tracker.last_step.index, score, *row.tolist()])
    (HERE / "compact_golden.json").write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
