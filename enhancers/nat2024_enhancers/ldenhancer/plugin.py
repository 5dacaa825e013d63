"""LDEnhancer as an enhancer: sizes, options and weights around the network of `model`."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast

from nat2024.backends import TORCH_FIRST, Part
from nat2024.cards import read_card
from nat2024.errors import InvalidOption
from nat2024.interfaces import NeuralEnhancer
from nat2024.registry import register_enhancer
from nat2024.zoo import preset_weights
from nat2024_enhancers.ldenhancer.settings import ABLATION, PRESETS, LDEnhancerSettings

if TYPE_CHECKING:
    import torch

    from nat2024_enhancers.ldenhancer.model import LDEnhancerNet


@register_enhancer("ldenhancer")
class LDEnhancer(NeuralEnhancer):
    """Suppresses the light distribution of night images before a daytime tracker sees them.

    `maps` gives `F0`, `F1`, `M` (N, 8, H / 16, W / 16), `O1`, `O2` (N, 3, H, W, 0 or more) and
    `P_S`, `P_E`, `A` (N, 3 * iterations, H, W, -1..1 and for A -2..2), H and W padded. Sides above
    8000 pixels raise `ArrayContract`: the network knows 500 positions each way.
    """

    card = read_card("nat2024_enhancers.ldenhancer")
    fastest_backends = TORCH_FIRST
    stride = 16
    can_replay = True
    training_settings = LDEnhancerSettings()
    training_presets: ClassVar[Mapping[str, Mapping[str, Any]]] = PRESETS
    ablation: ClassVar[Mapping[str, Mapping[str, Any]]] = ABLATION

    def __init__(
        self,
        *,
        pad_multiple: Literal[8, 16] = 16,
        iteration_sign: Literal["code", "paper"] = "code",
        iterations: int = 4,
        two_branch: bool = True,
        light_loss: bool = True,
        cross_attention: bool = True,
        preset: Literal["default", "adaptive", "bright"] | None = None,
        **base: Any,
    ) -> None:
        """Build the network and load its weights; `base` as in `NeuralEnhancer`.

        Args:
            pad_multiple: sides are padded up to a multiple of this. The official code pads to 8,
                though its network needs 16; with 8 an image fails where it fails there, with
                `ArrayContract`, and gives the same numbers elsewhere.
            iteration_sign: "code" adds A (x^2 - x) as the official code does, "paper" adds
                A x (1 - x) as the paper writes; official weights need "code".
            iterations: how often the curves are applied; the official weights are for 4.
            two_branch: False is the paper's baseline, without a light branch.
            light_loss: in training, whether the light branch is held to the light label; else
                the contrast of the image itself is kept.
            cross_attention: False leaves the attention out.
            preset: which of the weights that come with the package: "default" lifts as the
                authors' do, "adaptive" lifts dark places more than bright ones, "bright" is for
                very dark video. None takes registered weights, else "default".
            base: `weights`, `device`, `clamp`, `channel_order`.

        Raises:
            InvalidOption: no iteration, attention or a light loss without two branches, or a
                preset beside other weights.
        """
        if not two_branch and (light_loss or cross_attention):
            msg = "ldenhancer.two_branch=false needs light_loss=false and cross_attention=false"
            raise InvalidOption(msg)
        if iterations < 1:
            msg = f"ldenhancer.iterations must be at least 1, not {iterations}"
            raise InvalidOption(msg)
        self.iterations = iterations
        self.two_branch, self.light_loss = two_branch, light_loss
        self.cross_attention = cross_attention
        self.iteration_sign: Literal["code", "paper"] = iteration_sign
        self.stride = pad_multiple
        self.preset = preset
        base["weights"] = preset_weights(self.name, preset, base.get("weights"), self.card)
        super().__init__(**base)

    def build(self) -> "LDEnhancerNet":
        """The network, with the official checkpoint's 120 keys."""
        from nat2024_enhancers.ldenhancer.model import LDEnhancerNet

        return LDEnhancerNet(
            iterations=self.iterations,
            iteration_sign=self.iteration_sign,
            two_branch=self.two_branch,
            cross_attention=self.cross_attention,
        )

    def forward(self, batch: "torch.Tensor") -> "torch.Tensor":
        """Enhance a padded batch; no clamp."""
        return cast("LDEnhancerNet", self.model).enhance(batch)

    def parts(self) -> dict[str, Part]:
        """All but the attention, which needs less memory and time here than as a graph."""
        network = cast("LDEnhancerNet", self.model)
        return {"encode": Part(network.encode), "adjust": Part(network.adjust)}

    def forward_parts(
        self, parts: "Mapping[str, Callable[..., Any]]", batch: "torch.Tensor"
    ) -> "torch.Tensor":
        """Enhance a padded batch as `forward` does."""
        network = cast("LDEnhancerNet", self.model)
        return network.enhance_in_parts(batch, parts["encode"], parts["adjust"])

    def forward_maps(self, batch: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """All intermediate maps of a padded batch."""
        return cast("LDEnhancerNet", self.model).maps(batch)

    @property
    def targets_title(self) -> str:
        """The parameters of the labels, for the name of their folder; empty without labels."""
        return self.training_settings.label_settings.title if self.light_loss else ""

    def targets(self, images: "torch.Tensor") -> "dict[str, torch.Tensor]":
        """The labels `light` (I_l) and `content` (I_o) of images, (N, 3, H, W) in 0..1."""
        from nat2024_enhancers.ldenhancer.light_label import light_labels

        light, content = light_labels(images, self.training_settings.label_settings)
        return {"light": light, "content": content}

    def begin_training(self) -> None:
        """Scale initial weights and set the dropout as the settings say."""
        from nat2024_enhancers.ldenhancer.training import prepare_network

        prepare_network(cast("LDEnhancerNet", self.model), self.training_settings)

    def loss(self, batch: "Mapping[str, Any]") -> "dict[str, torch.Tensor]":
        """The weighted terms of a batch: `image`, and with a light loss `light` and `content`."""
        from nat2024_enhancers.ldenhancer.training import loss_terms

        settings, model = self.training_settings, cast("LDEnhancerNet", self.model)
        return loss_terms(model, batch, settings, light_loss=self.light_loss)
