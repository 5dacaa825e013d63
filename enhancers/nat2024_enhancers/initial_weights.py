"""Initial weights as the official code of several enhancers draws them."""

from torch import nn


def draw_normal_weights(network: nn.Module, spread: float) -> None:
    """Give convolutions and linear layers weights from N(0, `spread`); biases stay, 0 keeps all."""
    if spread:
        for module in network.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.normal_(module.weight, 0.0, spread)
