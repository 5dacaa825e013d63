"""Writes kindpp_golden.json from the implementation; run only when it is meant to change.

The implementation that wrote it equals the official code on the parity kit; weights and input come
from formulas (tests/enhancers/conftest.py and kindpp/conftest.py), so that a bare checkout can
compare.
"""

import importlib.util
import json
from pathlib import Path

import torch

from nat2024_enhancers.kindpp.convert import from_tensorflow
from nat2024_enhancers.kindpp.model import KindPlusPlusNet, normalise

HERE = Path(__file__).parent


def load(name, path):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main() -> None:
    """Describe all maps of the network with procedural weights on a procedural batch."""
    helpers = load("enhancer_conftest", HERE.parent / "enhancers" / "conftest.py")
    own = load("kindpp_conftest", HERE.parent / "enhancers" / "kindpp" / "conftest.py")
    variables = {
        name: own.make_variable(name, shape) for name, shape in own.tensorflow_names().items()
    }
    network = KindPlusPlusNet().eval()
    network.load_state_dict({**network.state_dict(), **from_tensorflow(variables)})
    batch = normalise(helpers.make_procedural_batch("kindpp.input", (2, 3, 16, 24)))
    with torch.no_grad():
        arrays = {"enhanced": network(batch), "adjusted": network(batch, 5.0)}
        arrays |= network.maps(batch, 5.0)
    golden = {name: helpers.describe_array(array) for name, array in arrays.items()}
    lines = json.dumps(golden, indent=1).replace("\n   ", " ").replace("\n  ]", " ]")
    (HERE / "kindpp_golden.json").write_text(lines + "\n")


if __name__ == "__main__":
    main()
