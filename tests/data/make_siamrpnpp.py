"""Writes siamrpnpp_golden.json from the implementation; run only when it is meant to change.

The implementation that wrote it equals the official code on the parity kit; weights and frames come
from formulas (tests/trackers/conftest.py), so that a bare checkout can compare.
"""

import importlib.util
import json
from pathlib import Path

from nat2024_trackers.siamrpnpp.plugin import SiamRPNpp

HERE = Path(__file__).parent


def main() -> None:
    """Track the generated clip, plain and with a gamma curve on the crops."""
    spec = importlib.util.spec_from_file_location(
        "tracker_conftest", HERE.parent / "trackers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    state = helpers.make_procedural_state(helpers.read_recipe())
    frames, box = helpers.make_clip()
    runs = {}
    for name, enhancer in (("plain", None), ("gamma", helpers.Gamma(0.8))):
        tracker = SiamRPNpp(weights=False, enhancer=enhancer)
        tracker.model.load_state_dict(state)
        rows = [{"box": tracker.init(frames[0], box).tolist()}]
        for frame in frames[1:]:
            row, score = tracker.update(frame)
            step = tracker.last_step
            rows.append(
                {
                    "box": row.tolist(),
                    "score": score,
                    "pscore": step.pscore,
                    "index": step.index,
                    "crop_side": step.crop_side,
                }
            )
        runs[name] = rows
    (HERE / "siamrpnpp_golden.json").write_text(json.dumps(runs, indent=1) + "\n")


if __name__ == "__main__":
    main()
