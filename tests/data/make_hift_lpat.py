"""Writes hift_golden.json and lpat_golden.json from the implementation.

Run only when they are meant to change. The implementation that wrote them equals the official code
on the parity kit; weights and frames come from formulas (tests/trackers/conftest.py), so that a
bare checkout can compare. Networks of both trackers have the same first and last layers, whose
weights are chosen so that classes vary over the map and boxes look like boxes.
"""

import importlib.util
import json
import zlib
from pathlib import Path

import torch

from nat2024_trackers.hift.plugin import HiFT
from nat2024_trackers.lpat.plugin import LPAT

HERE = Path(__file__).parent
UPDATES = 4
SPECIAL = {
    "backbone.layer1.0.weight": {"scale": 5e-3},
    "grader.conv1.0.weight": {"scale": 1.5e-3},
    "grader.conv3.0.weight": {"scale": 1.5e-3},
    "grader.conv2.0.weight": {"scale": 3e-3},
    "grader.convloc.9.weight": {"scale": 3e-3},
    "grader.convloc.9.bias": {"values": [0.15, 0.15, 0.26, 0.26]},
    "grader.cls1.weight": {"scale": 0.1},
    "grader.cls2.weight": {"scale": 0.02},
    "grader.cls2.bias": {"values": [0.4]},
}
SHARED_NORM = {
    f"grader.transformer.encoder1.norm.{name}": {
        "same_as": f"grader.transformer.encoder2.norm.{name}"
    }
    for name in ("weight", "bias")
}


def main() -> None:
    """Describe the maps of a pair of crops and follow the generated clip, plain and enhanced."""
    spec = importlib.util.spec_from_file_location(
        "tracker_conftest", HERE.parent / "trackers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    for plugin, special in ((HiFT, SPECIAL), (LPAT, SPECIAL | SHARED_NORM)):
        write(plugin, special, helpers)


def write(plugin, special, helpers) -> None:
    """Write the golden numbers of one tracker."""
    tracker = plugin(weights=False)
    recipe = helpers.make_recipe(tracker.model, plugin.name, special)
    tracker.model.load_state_dict(helpers.make_procedural_state(recipe))
    entries = [f"{key} {entry['shape']}" for key, entry in recipe["tensors"].items()]
    template, search = helpers.make_crops(1)
    with torch.no_grad():
        maps = tracker.model(template, search)
    golden = {
        "special": special,
        "entries": len(entries),
        "entries_crc32": zlib.crc32("\n".join(entries).encode()),
        "maps": [[round(v, 7) for v in one[0, :, ::5, ::5].flatten().tolist()] for one in maps],
    }
    frames, box = helpers.make_clip()
    for name, enhancer in (("plain", None), ("gamma", helpers.Gamma(0.8))):
        tracker.enhancer = enhancer
        rows = [{"box": tracker.init(frames[0], box).tolist()}]
        for frame in frames[1 : UPDATES + 1]:
            row, score = tracker.update(frame)
            step = tracker.last_step
            found = {"box": row.tolist(), "score": score, "pscore": step.pscore}
            rows.append(found | {"index": step.index, "crop_side": step.crop_side})
        golden[name] = rows
    lines = json.dumps(golden, indent=1).replace("\n    ", " ").replace("\n   ]", " ]")
    (HERE / f"{plugin.name}_golden.json").write_text(lines + "\n")


if __name__ == "__main__":
    main()
