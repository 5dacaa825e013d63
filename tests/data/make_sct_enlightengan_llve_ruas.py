"""Writes NAME_golden.json of four enhancers; run only when they are meant to change.

The implementations that wrote them equal the official code on the parity kit; weights and input
come from formulas (tests/enhancers/conftest.py), so that a bare checkout can compare.
"""

import importlib.util
import json
from pathlib import Path

import torch

from nat2024_enhancers.enlightengan.model import EnlightenGANNet
from nat2024_enhancers.llve.model import LLVENet
from nat2024_enhancers.ruas.model import RUASNet
from nat2024_enhancers.sct.model import SCTNet

HERE = Path(__file__).parent
NETWORKS = {
    "sct": SCTNet,
    "enlightengan": EnlightenGANNet,
    "llve": LLVENet,
    "ruas": RUASNet,
}


def main() -> None:
    """Describe the answer and all maps of each network with procedural weights."""
    spec = importlib.util.spec_from_file_location(
        "enhancer_conftest", HERE.parent / "enhancers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    for name, build in NETWORKS.items():
        network = build().eval()
        network.load_state_dict(helpers.make_procedural_state(network))
        batch = helpers.make_procedural_batch(f"{name}.input", (2, 3, 37, 53))
        with torch.no_grad():
            maps = network.maps(batch) if hasattr(network, "maps") else {}
            arrays = {"enhanced": network(batch), **maps}
        golden = {
            "state_dict": {key: list(value.shape) for key, value in network.state_dict().items()},
            "maps": {key: helpers.describe_array(array) for key, array in arrays.items()},
        }
        lines = json.dumps(golden, indent=1).replace("\n   ", " ").replace("\n  ]", " ]")
        (HERE / f"{name}_golden.json").write_text(lines + "\n")


if __name__ == "__main__":
    main()
