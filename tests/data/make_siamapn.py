"""Writes siamapn_golden.json and siamapnpp_golden.json from the implementation.

Run only when they are meant to change; see make_hift_lpat.py, whose form they have. The weights of
each layer are scaled so that its output is spread like a standard normal on a pair of dark crops.
"""

import importlib.util
import math
from pathlib import Path

import torch
from make_hift_lpat import write
from torch import nn

from nat2024_trackers.siamapn.plugin import SiamAPN
from nat2024_trackers.siamapnpp.plugin import SiamAPNpp

HERE = Path(__file__).parent
# anchors as large as the target, classes that vary over the map, boxes near their anchors
ENDS = {
    "new.convloc.6": ({"scale": 0.002}, [0.0, 0.0, 0.0, 0.0]),
    "new.convloc.12": ({"scale": 0.002}, [0.0, 0.0, 0.0, 0.0]),
    "grader.conv_shape.3": ({"scale": 2e-4}, [0.16, 0.16, 0.29, 0.29]),
    "grader.anchor": ({"scale": 5e-4}, [0.32, 0.32, 0.58, 0.58]),
    "new.cls1": ({"scale": 0.02}, [0.0, 0.5]),
    "new.cls2": ({"scale": 0.02}, [0.0, 0.5]),
    "new.cls3": ({"scale": 0.005}, [0.4]),
}


def main() -> None:
    """Calibrate and write both."""
    spec = importlib.util.spec_from_file_location(
        "tracker_conftest", HERE.parent / "trackers" / "conftest.py"
    )
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    for plugin in (SiamAPN, SiamAPNpp):
        write(plugin, calibrated(plugin, helpers), helpers)


def calibrated(plugin, helpers) -> dict:
    """What the recipe of a tracker has to override."""
    model = plugin(weights=False).model
    special, state = {}, model.state_dict()
    for name, (weight, values) in ENDS.items():
        if len(state.get(f"{name}.bias", ())) == len(values):
            special |= {f"{name}.weight": weight, f"{name}.bias": {"values": values}}
    recipe = helpers.make_recipe(model, plugin.name, special)
    model.load_state_dict(helpers.make_procedural_state(recipe))
    scales = {}
    for name, layer in model.named_modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d) and f"{name}.weight" not in special:
            layer.register_forward_hook(scaling(name, scales))
    model(*helpers.make_crops(1))  # with gradients, so that every layer runs by itself
    return special | scales


def scaling(name, scales):
    """A hook that scales the weights at the layer's first use, and its output with them."""

    def hook(layer, _inputs, output):
        key = f"{name}.weight"
        if key in scales or output[0].numel() < 1000:
            return output
        spread = 1 / math.sqrt(math.prod(layer.weight.shape[1:]))
        scale = float(f"{spread / float(output.detach().std()):.3g}")
        scales[key] = {"scale": scale}
        with torch.no_grad():
            layer.weight *= scale / spread
            bias = layer.bias.view(1, -1, 1, 1) if layer.bias is not None else 0
        return (output - bias) * (scale / spread) + bias

    return hook


if __name__ == "__main__":
    main()
