"""Writes the golden files of DCE++, DarkLighter and HighlightNet from the implementation.

Run only when they are meant to change. The implementation that wrote them equals the official code
on the parity kit; weights and input come from formulas (tests/enhancers/conftest.py), so that a
bare checkout can compare.
"""

import importlib.util
import json
from pathlib import Path

import torch

from nat2024.registry import create_enhancer

HERE = Path(__file__).parent


def main() -> None:
    """Describe all maps of the networks with procedural weights on a procedural batch."""
    spec = importlib.util.spec_from_file_location(
        "enhancer_conftest", HERE.parent / "enhancers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    for name in ("dcepp", "darklighter", "highlightnet"):
        enhancer = create_enhancer(name, weights=False, clamp=False)
        enhancer.model.load_state_dict(helpers.make_procedural_state(enhancer.model))
        batch = helpers.make_procedural_batch(f"{name}.input", (2, 3, 47, 80))
        arrays = {"enhanced": enhancer.enhance_batch(batch), **enhancer.maps(batch)}
        state = enhancer.model.state_dict()
        golden = {
            "state_dict": {key: list(value.shape) for key, value in state.items()},
            "maps": {key: helpers.describe_array(array) for key, array in arrays.items()},
        }
        lines = json.dumps(golden, indent=1).replace("\n   ", " ").replace("\n  ]", " ]")
        (HERE / f"{name}_golden.json").write_text(lines + "\n")


if __name__ == "__main__":
    with torch.no_grad():
        main()
