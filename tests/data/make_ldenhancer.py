"""Writes ldenhancer_golden.json from the implementation; run only when it is meant to change.

The implementation that wrote it equals the official code on the parity kit; weights and input come
from formulas (tests/enhancers/conftest.py), so that a bare checkout can compare.
"""

import importlib.util
import json
from pathlib import Path

import torch

from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

HERE = Path(__file__).parent


def main() -> None:
    """Describe all maps of the network with procedural weights on a procedural batch."""
    spec = importlib.util.spec_from_file_location(
        "enhancer_conftest", HERE.parent / "enhancers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    network = LDEnhancerNet().eval()
    network.load_state_dict(helpers.make_procedural_state(network))
    batch = helpers.make_procedural_batch("ldenhancer.input", (2, 3, 48, 80))
    with torch.inference_mode():
        arrays = {"enhanced": network(batch)[0], **network.maps(batch)}
    golden = {
        "state_dict": {key: list(value.shape) for key, value in network.state_dict().items()},
        "maps": {name: helpers.describe_array(array) for name, array in arrays.items()},
    }
    lines = json.dumps(golden, indent=1).replace("\n   ", " ").replace("\n  ]", " ]")
    (HERE / "ldenhancer_golden.json").write_text(lines + "\n")


if __name__ == "__main__":
    main()
