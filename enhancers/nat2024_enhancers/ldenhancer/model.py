"""The network of LDEnhancer (Yao et al., IROS 2024), symbols as in the paper.

An image is brought to 1/16 of its size and split into light features F1 and content features F2.
Both are decoded to images, O2 (the light distribution) and O1 (the content, after cross attention
of F2 to F1); two small nets estimate the curve parameters P_S and P_E of every pixel from them, and
the difference of the two curves lights the image up without lighting its lamps up.

Images are float32 (N, 3, H, W), sides multiples of 16; feature maps are NCHW, tokens (N, H*W, C).
Names of modules are those of the official state dict.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nat2024.errors import ArrayContract
from nat2024.networks.bands import bands_of
from nat2024.networks.convolving import convolve_pair
from nat2024.networks.folding import Derived, fold_batch_norm, may_derive
from nat2024_enhancers.ldenhancer.attention import fused_attention, scalar_attention

STRIDE = 16
"""How much smaller the feature maps are than the image."""

_FEATURES = 8
_GROUP = 3  # one curve parameter for each colour
_TABLE = 500
_PART_PIXELS = 1 << 19  # of a band of `enhance_in_parts`
_HALO = 5  # the estimation net's five 3x3 convolutions see this far


class Down(nn.Module):
    """Halves both sides."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv = nn.Sequential(
            nn.Conv2d(inputs, outputs, 2, 2), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
        )
        self._folded = Derived(self, self._fold)

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, H / 2, W / 2)."""
        if may_derive(self):
            return F.relu_(F.conv2d(x, *self._folded(), stride=2))
        return self.conv(x)  # type: ignore[no-any-return]

    def _fold(self) -> tuple[Tensor, Tensor]:
        layer, norm, _ = self.conv
        return fold_batch_norm(layer, norm)  # type: ignore[arg-type]


class Up(nn.Module):
    """Doubles both sides."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.upsample = nn.Sequential(
            nn.ConvTranspose2d(inputs, outputs, 2, 2),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )
        self._folded = Derived(self, self._fold)

    def forward(self, x: Tensor) -> Tensor:
        """(N, inputs, H, W) to (N, outputs, 2 H, 2 W)."""
        if not may_derive(self):
            return self.upsample(x)  # type: ignore[no-any-return]
        # Every pixel becomes 2 x 2 pixels of its own: a product of matrices, channels last.
        matrix, bias = self._folded()
        count, inputs, height, width = x.shape
        pixels = torch.addmm(bias, x.permute(0, 2, 3, 1).reshape(-1, inputs), matrix).relu_()
        blocks = pixels.view(count, height, width, 2, 2, -1).transpose(2, 3)
        return blocks.reshape(count, 2 * height, 2 * width, -1).permute(0, 3, 1, 2)

    def _fold(self) -> tuple[Tensor, Tensor]:
        layer, norm, _ = self.upsample
        weight, bias = fold_batch_norm(layer, norm)  # type: ignore[arg-type]
        return weight.permute(0, 2, 3, 1).flatten(1).contiguous(), bias.repeat(4)


class Encoder(nn.Module):
    """Image to features F0 at 1/16 of the size."""

    def __init__(self) -> None:
        super().__init__()
        self.d1 = Down(3, 4)
        self.d2 = Down(4, 4)
        self.d3 = Down(4, _FEATURES)
        self.d4 = Down(_FEATURES, _FEATURES)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, H, W) to (N, 8, H / 16, W / 16)."""
        return self.d4(self.d3(self.d2(self.d1(x))))  # type: ignore[no-any-return]


class Decoder(nn.Module):
    """Features to an image, which has no upper bound: the last step is a ReLU as well."""

    def __init__(self) -> None:
        super().__init__()
        self.u1 = Up(_FEATURES, _FEATURES)
        self.u2 = Up(_FEATURES, 4)
        self.u3 = Up(4, 4)
        self.u4 = Up(4, 3)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 8, H / 16, W / 16) to (N, 3, H, W)."""
        return self.u4(self.u3(self.u2(self.u1(x))))  # type: ignore[no-any-return]


class AttentionLayer(nn.Module):
    """Post-norm transformer layer whose queries and keys come from different features."""

    def __init__(self, heads: int, ffn: int, dropout: float) -> None:
        super().__init__()
        self.multihead_attn = nn.MultiheadAttention(_FEATURES, heads, dropout, batch_first=True)
        self.linear1 = nn.Linear(_FEATURES, ffn)
        self.linear2 = nn.Linear(ffn, _FEATURES)
        self.norm1 = nn.LayerNorm(_FEATURES)
        self.norm2 = nn.LayerNorm(_FEATURES)
        self.dropout = nn.Dropout(dropout)

    def forward(self, content: Tensor, light: Tensor, position: Tensor) -> Tensor:
        """Tokens (N, L, 8) of F2 and F1 and position codes (L, 8) to tokens (N, L, 8)."""
        attended = self._attend(content + position, light + position, light)
        middle = self.norm1(content + self.dropout(attended))
        hidden = self.dropout(F.relu(self.linear1(middle)))
        return self.norm2(middle + self.dropout(self.linear2(hidden)))  # type: ignore[no-any-return]

    def _attend(self, query: Tensor, key: Tensor, value: Tensor) -> Tensor:
        # nn.MultiheadAttention itself may build the (L, L) matrix: 2 GB for a 1920x1080 image.
        attention = self.multihead_attn
        weights = attention.in_proj_weight.chunk(3)
        biases = attention.in_proj_bias.chunk(3)
        q, k, v = (
            F.linear(tokens, weight, bias)
            .view(*tokens.shape[:2], attention.num_heads, -1)
            .transpose(1, 2)
            for tokens, weight, bias in zip((query, key, value), weights, biases, strict=True)
        )
        on_cpu = query.device.type == "cpu"
        if on_cpu and may_derive(self) and q.shape[-1] == 1 and q.dtype == torch.float32:
            attended = scalar_attention(q, k, v)
        else:
            dropout = attention.dropout if self.training else 0.0
            # The CPU's kernel takes head dimension 1 as it is, CUDA's want multiples of 8.
            multiple = 8 if query.device.type == "cuda" else 1
            attended = fused_attention(q, k, v, dropout=dropout, head_multiple=multiple)
        return attention.out_proj(attended.transpose(1, 2).flatten(2))  # type: ignore[no-any-return]


class CrossAttention(nn.Module):
    """Takes out of the content features what the light features explain."""

    def __init__(self, heads: int, ffn: int, dropout: float) -> None:
        super().__init__()
        self.layer = AttentionLayer(heads, ffn, dropout)
        self.row_embed = nn.Embedding(_TABLE, _FEATURES // 2)
        self.col_embed = nn.Embedding(_TABLE, _FEATURES // 2)

    def forward(self, content: Tensor, light: Tensor, place: tuple[int, int] = (0, 0)) -> Tensor:
        """F2 and F1, both (N, 8, h, w), to M of the same shape; `place` as in `LDEnhancerNet`."""
        height, width = content.shape[-2:]
        top, left = place
        columns = self.col_embed.weight[left : left + width].expand(height, -1, -1)
        rows = self.row_embed.weight[top : top + height, None].expand(-1, width, -1)
        position = torch.cat([columns, rows], dim=-1).flatten(0, 1)
        tokens = self.layer(_to_tokens(content), _to_tokens(light), position)
        # Contiguous for the BatchNorms: their CPU statistics of channels-last data are inexact.
        return tokens.transpose(1, 2).contiguous().unflatten(-1, (height, width))  # type: ignore[no-any-return]


def _to_tokens(features: Tensor) -> Tensor:
    return features.flatten(2).transpose(1, 2)


class CurveEstimation(nn.Module):
    """Curve parameters of every pixel, -1..1, from a decoded image."""

    def __init__(self, outputs: int) -> None:
        super().__init__()
        self.e_conv1 = nn.Conv2d(3, 16, 3, padding=1)
        self.e_conv2 = nn.Conv2d(16, 16, 3, padding=1)
        self.e_conv3 = nn.Conv2d(16, 16, 3, padding=1)
        self.e_conv4 = nn.Conv2d(32, 16, 3, padding=1)
        self.e_conv5 = nn.Conv2d(32, outputs, 3, padding=1)
        self._prepared = Derived(self, self._prepare)

    def forward(self, x: Tensor) -> Tensor:
        """(N, 3, H, W) to (N, outputs, H, W)."""
        # On a CPU convolutions of 16 channels take half the time channels-last.
        x1 = F.relu_(self.e_conv1(x.contiguous(memory_format=torch.channels_last)))
        x2 = F.relu_(self.e_conv2(x1))
        x3 = F.relu_(self.e_conv3(x2))
        x4 = F.relu_(convolve_pair(self.e_conv4, x2, x3))
        return torch.tanh(convolve_pair(self.e_conv5, x1, x4))

    def sigmoids(self, x: Tensor, start: int, stop: int) -> Tensor:
        """Rows `start` to `stop` of (1 + `forward`) / 2, for inference: tanh a = 2 sigmoid 2a - 1.

        A sigmoid takes a fifth of the time of a tanh on a CPU.
        """
        first, second, third, fourth, fourth_more, fifth, fifth_more = self._prepared()
        band = _Band(above=start > 0, below=stop < x.shape[-2])
        x = x[..., max(start - _HALO, 0) : stop + _HALO, :]
        x1 = F.relu_(band.convolve(x.contiguous(memory_format=torch.channels_last), first))
        x2 = F.relu_(band.convolve(x1, second))
        x3 = F.relu_(band.convolve(x2, third))
        x4 = band.convolve(band.cut(x2, 1), fourth)
        x4 = F.relu_(x4.add_(band.convolve(x3, fourth_more)))
        last = band.convolve(band.cut(x1, 3), fifth)
        return last.add_(band.convolve(x4, fifth_more)).sigmoid_()

    def _prepare(self) -> list[tuple[Tensor, Tensor | None]]:
        prepared: list[tuple[Tensor, Tensor | None]] = []
        for layer in (self.e_conv1, self.e_conv2, self.e_conv3, self.e_conv4, self.e_conv5):
            factor = 2 if layer is self.e_conv5 else 1
            bias: Tensor | None = layer.bias * factor if layer.bias is not None else None
            parts = 1 if layer.in_channels <= 16 else 2
            for weight in (layer.weight * factor).chunk(parts, dim=1):
                prepared.append((weight.contiguous(memory_format=torch.channels_last), bias))
                bias = None
        return prepared


class _Band(NamedTuple):
    """Rows of an image that goes on above or below them, and is zero beyond its ends."""

    above: bool
    below: bool

    def cut(self, x: Tensor, rows: int) -> Tensor:
        """`x` without this many rows at the sides where the image goes on."""
        return x[..., rows * self.above : x.shape[-2] - rows * self.below, :]

    def convolve(self, x: Tensor, layer: tuple[Tensor, Tensor | None]) -> Tensor:
        """3x3 convolution, one row shorter at the sides where the image goes on."""
        inside = self.above and self.below
        convolved = F.conv2d(x, *layer, padding=(0 if inside else 1, 1))
        return convolved if inside else self.cut(convolved, 1)


class Features(NamedTuple):
    """What is known before the curves are estimated."""

    F0: Tensor
    F1: Tensor
    M: Tensor
    O1: Tensor
    O2: Tensor


class LDEnhancerNet(nn.Module):
    """LDEnhancer for images whose sides are multiples of 16.

    Args:
        iterations: how often the curves are applied, each time with their own parameters.
        iteration_sign: "code" adds A (x^2 - x) as the official code does, "paper" adds A x (1 - x).
        heads: attention heads; they divide 8.
        ffn: width of the layer after the attention.
        dropout: in the attention and after it, in training.
        two_branch: False leaves the light branch out, for the paper's ablation: one decoder and
            one estimation net, A = P_E, and O2 is O1.
        cross_attention: False decodes F2 as it is, likewise.
    """

    def __init__(
        self,
        *,
        iterations: int = 4,
        iteration_sign: Literal["code", "paper"] = "code",
        heads: int = 8,
        ffn: int = 64,
        dropout: float = 0.3,
        two_branch: bool = True,
        cross_attention: bool = True,
    ) -> None:
        super().__init__()
        self.two_branch, self.cross_attention = two_branch, cross_attention
        self.sign = 1.0 if iteration_sign == "code" else -1.0
        self.downsamplenet = Encoder()
        if two_branch:
            self.upsamplenet_light = Decoder()
        self.upsamplenet_content = Decoder()
        if cross_attention:
            self.CrossAttention = CrossAttention(heads, ffn, dropout)
        if two_branch:
            self.decompose = nn.Conv2d(_FEATURES, _FEATURES, 1)
            self.light_estimation = CurveEstimation(_GROUP * iterations)
        self.content_estimation = CurveEstimation(_GROUP * iterations)

    def forward(
        self, image: Tensor, place: tuple[int, int] = (0, 0)
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Enhance images.

        Args:
            image: (N, 3, H, W).
            place: row and column, in cells of 16 pixels, where these images were cut out of
                larger ones, so that crops train all positions.

        Returns:
            The enhanced images (N, 3, H, W), not clamped; O2 (N, 3, H, W); and A = P_E - P_S,
            (N, 3 * iterations, H, W), -2..2.

        Raises:
            ArrayContract: a side is no multiple of 16 or above 8000 pixels.
        """
        features = self._features(image, place)
        if may_derive(self):
            count, _, height, width = image.shape
            channels = self.content_estimation.e_conv5.out_channels
            amount = image.new_empty((count, channels, height, width))
            return self._apply_in_bands(image, features, amount), features.O2, amount
        amount = self.content_estimation(features.O1)
        if self.two_branch:
            amount = amount - self.light_estimation(features.O2)
        amount = amount.contiguous()
        return self._iterate(image, amount), features.O2, amount

    def enhance(self, image: Tensor) -> Tensor:
        """Only the enhanced images of `forward`; for inference A is not kept as a whole."""
        if may_derive(self):
            return self._apply_in_bands(image, self._features(image))
        return self(image)[0]  # type: ignore[no-any-return]

    def maps(self, image: Tensor) -> dict[str, Tensor]:
        """All intermediate maps of an image by their names in the paper; see `forward`."""
        features = self._features(image)
        content = self.content_estimation(features.O1)
        if not self.two_branch:
            return {"F0": features.F0, "O1": features.O1, "P_E": content, "A": content}
        light = self.light_estimation(features.O2)
        found = {**features._asdict(), "P_S": light, "P_E": content, "A": content - light}
        if not self.cross_attention:
            del found["M"]
        return found

    def encode(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """F2 and F1, (N, 8, H / 16, W / 16) each, of images (N, 3, H, W); without branches F0."""
        return self._split(image)[1:]

    def adjust(self, image: Tensor, attended: Tensor, light: Tensor) -> Tensor:
        """Enhanced images of M and F1: all that follows the attention."""
        amount = self.content_estimation(self.upsamplenet_content(attended))
        if self.two_branch:
            amount = amount - self.light_estimation(self.upsamplenet_light(light))
        return self._iterate(image, amount)

    def enhance_in_parts(
        self,
        image: Tensor,
        encode: Callable[[Tensor], tuple[Tensor, Tensor]],
        adjust: Callable[[Tensor, Tensor, Tensor], Tensor],
    ) -> Tensor:
        """Enhance with what stands for `encode` and `adjust`; the attention stays here.

        `adjust` is given bands of rows, so that its memory does not grow with the image.
        """
        _check_sides(*image.shape[-2:])
        content, light = encode(image)
        attended = self.CrossAttention(content, light) if self.cross_attention else content
        count, _, height, width = image.shape
        found = []
        for start, stop in bands_of(count, height, width, stride=STRIDE, pixels=_PART_PIXELS):
            # One cell more on each side, since the convolutions see `_HALO` rows.
            above, below = max(start - STRIDE, 0), min(stop + STRIDE, height)
            cells = slice(above // STRIDE, below // STRIDE)
            band = adjust(image[..., above:below, :], attended[..., cells, :], light[..., cells, :])
            found.append(band[..., start - above : stop - above, :])
        return found[0] if len(found) == 1 else torch.cat(found, dim=-2)

    def _features(self, image: Tensor, place: tuple[int, int] = (0, 0)) -> Features:
        _check_sides(*image.shape[-2:])
        mixed, content, light = self._split(image.contiguous())
        attended = self.CrossAttention(content, light, place) if self.cross_attention else content
        content_image = self.upsamplenet_content(attended)
        light_image = self.upsamplenet_light(light) if self.two_branch else content_image
        return Features(mixed, light, attended, content_image, light_image)

    def _split(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """F0, F2 and F1."""
        mixed = self.downsamplenet(image)
        if not self.two_branch:
            return mixed, mixed, mixed
        light = self.decompose(mixed)
        return mixed, mixed - light, light

    def _apply_in_bands(
        self, image: Tensor, features: Features, amount: Tensor | None = None
    ) -> Tensor:
        """The enhanced images, band by band: the same numbers with a fraction of the memory.

        Where `amount` is given, it is filled with A.
        """
        count, _, height, width = image.shape
        enhanced = image.clone(memory_format=torch.contiguous_format)
        bands = bands_of(count, height, width, stride=STRIDE, device=image.device)
        for start, stop in bands:
            rows = slice(start, stop)
            content = self.content_estimation.sigmoids(features.O1, start, stop)
            content -= (
                self.light_estimation.sigmoids(features.O2, start, stop) if self.two_branch else 0.5
            )
            band = enhanced[..., rows, :]
            halves = content.contiguous()
            for step in halves.chunk(halves.shape[1] // _GROUP, dim=1):
                band.addcmul_(step, band * band - band, value=2 * self.sign)
            if amount is not None:
                torch.mul(halves, 2, out=amount[..., rows, :])
        return enhanced

    def _iterate(self, image: Tensor, amount: Tensor) -> Tensor:
        for step in amount.chunk(amount.shape[1] // _GROUP, dim=1):
            image = torch.addcmul(image, step, image * image - image, value=self.sign)
        return image


def _check_sides(height: int, width: int) -> None:
    if height % STRIDE or width % STRIDE:
        msg = (
            f"LDEnhancer takes sides that are multiples of {STRIDE}, not {width}x{height}; "
            f"pad_multiple={STRIDE} pads any image to such sides"
        )
        raise ArrayContract(msg)
    longest = _TABLE * STRIDE
    if max(height, width) > longest:
        msg = (
            f"LDEnhancer takes at most {longest} pixels a side (it knows {_TABLE} positions), "
            f"not {width}x{height}; scale the image down or enhance parts of it"
        )
        raise ArrayContract(msg)
