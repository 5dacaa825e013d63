"""How LDEnhancer is trained: the values of its loss, presets, and the variants of the ablation."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

import msgspec

Weight = Annotated[float, msgspec.Meta(ge=0.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]
Rule = Literal["excess", "published"]
Labels = Literal["same_lambda", "demo"]


class LabelSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How light labels are made.

    Attributes:
        lam: weight of the light's smoothness; the larger, the less light.
        passes: how often edges are chosen anew.
        rule: "excess", or "published" as the code has it.
        labels: "same_lambda" takes both labels from one separation, "demo" the content of lam 50
            and the light of lam 25000 as the published demonstration does.
        save_gain: factor on both labels, limited to 1; the demonstration shows them with 2.
    """

    lam: Positive = 500.0
    passes: Annotated[int, msgspec.Meta(ge=1)] = 3
    rule: Rule = "excess"
    labels: Labels = "same_lambda"
    save_gain: Positive = 1.0

    @property
    def title(self) -> str:
        """The parameters as part of a file name."""
        lam = f"lam{self.lam:g}" if self.labels == "same_lambda" else "demo"
        gain = [f"gain{self.save_gain:g}"] if self.save_gain != 1 else []
        return "-".join(["light", lam, f"passes{self.passes}", self.rule, *gain])


class LDEnhancerSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Values of the loss and of the start; the defaults are the official code's.

    Attributes:
        spatial: weight of spatial consistency with I_o.
        colour: weight of colour constancy.
        colour_least: added under its root, whose gradient of a grey image is NaN else.
        smoothness: weight of the smoothness of A, beside the 2 of the code.
        exposure: weight of the exposure.
        level: K, the wanted level of `gain` times the image.
        gain: alpha.
        region: side of the regions whose level is looked at, pixels.
        light: weight of the light distribution.
        dropout: in the attention and after it.
        last_layer_scale: factor on the initial weights of both last layers; 0.1 starts near A = 0.
        position_scale: factor on the initial position tables; 0.02 keeps untrained rows harmless.
        lam: see `LabelSettings`, like all that follow.
        passes: how often edges are chosen anew.
        rule: of the labels.
        labels: which labels.
        save_gain: factor on the labels.
    """

    spatial: Weight = 10.0
    colour: Weight = 5.0
    colour_least: Weight = 1e-12
    smoothness: Weight = 1000.0
    exposure: Weight = 10.0
    level: Annotated[float, msgspec.Meta(ge=0, le=2)] = 0.6
    gain: Positive = 1.5
    region: Annotated[int, msgspec.Meta(ge=1)] = 16
    light: Weight = 1.0
    dropout: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.3
    last_layer_scale: float = 1.0
    position_scale: float = 1.0
    lam: Positive = 500.0
    passes: Annotated[int, msgspec.Meta(ge=1)] = 3
    rule: Rule = "excess"
    labels: Labels = "same_lambda"
    save_gain: Positive = 1.0

    @property
    def label_settings(self) -> LabelSettings:
        """How the labels are made."""
        return LabelSettings(
            lam=self.lam,
            passes=self.passes,
            rule=self.rule,
            labels=self.labels,
            save_gain=self.save_gain,
        )


_PAPER: dict[str, Any] = {
    "epochs": 100,
    "batch_size": 4,
    "learning_rate": 1e-6,
    "weight_decay": 1e-4,
    "clip": 0.1,
}
_SHORT: dict[str, Any] = {
    "steps": 400,
    "batch_size": 4,
    "learning_rate": 5e-4,
    "weight_decay": 1e-4,
    "warm_up": 20,
    "schedule": "cosine",
    "final_rate": 0.02,
    "clip": 0.1,
    "average": 0.98,
    "last_layer_scale": 0.1,
    "position_scale": 0.02,
    "crop": 128,
    "full_size_steps": 40,
    "mirror": 0.5,
    "swap_red_blue": 0.5,
    "draw": "uniform",
    "recalibrate": 60,
    "checkpoint_every": 100,
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": _PAPER,
        "default": {
            **_SHORT,
            "steps": 250,
            "level": 0.34,
            "full_size_steps": 10,
            "recalibrate": 15,
        },
        "adaptive": {**_SHORT, "level": 0.36, "smoothness": 5.0},
        "bright": {**_SHORT, "steps": 350, "level": 0.5},
    }
)
"""Settings by preset. "paper" is the authors' recipe: 279,000 steps on their data, on the way to
a much brighter end, so that the chosen epoch decides the brightness. The others come to rest after
minutes, and made the weights that come with the package: about as bright as the released weights;
with curves that differ over the image; far brighter."""

_OFF = {"two_branch": False, "light_loss": False, "cross_attention": False}
ABLATION: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "baseline": _OFF,
        "+TB": {**_OFF, "two_branch": True},
        "+TB+LS": {**_OFF, "two_branch": True, "light_loss": True},
        "+TB+LS+TF": dict.fromkeys(_OFF, True),
    }
)
"""Options of the variants of Table V of the paper."""
