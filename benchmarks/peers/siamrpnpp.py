"""SiamRPN++ (Li et al., CVPR 2019) with AlexNet, written plainly, as a yardstick for speed.

What the official code computes in its order, in the default memory layout; of the template the
features are kept, the kernels are computed in every frame. One sequence at a time.
"""

from peers.hift import correlate
from torch import Tensor, nn

ANCHORS = 5


class Backbone(nn.Module):
    """AlexNet without padding."""

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(3, 96, 11, stride=2),
            nn.BatchNorm2d(96),
            nn.MaxPool2d(3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(96, 256, 5),
            nn.BatchNorm2d(256),
            nn.MaxPool2d(3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(256, 384, 3),
            nn.BatchNorm2d(384),
            nn.ReLU(inplace=True),
            nn.Conv2d(384, 384, 3),
            nn.BatchNorm2d(384),
            nn.ReLU(inplace=True),
            nn.Conv2d(384, 256, 3),
            nn.BatchNorm2d(256),
        )

    def forward(self, crop: Tensor) -> Tensor:
        """Features of a crop (1, 3, S, S)."""
        return self.features(crop)


def conv(size: int) -> nn.Sequential:
    """Convolution, batch norm, ReLU."""
    convolution = nn.Conv2d(256, 256, size, bias=False)
    return nn.Sequential(convolution, nn.BatchNorm2d(256), nn.ReLU(inplace=True))


class Branch(nn.Module):
    """One branch of the head."""

    def __init__(self, outputs: int) -> None:
        super().__init__()
        self.conv_kernel, self.conv_search = conv(3), conv(3)
        self.head = conv(1)
        self.head.append(nn.Conv2d(256, outputs, 1))

    def forward(self, search: Tensor, template: Tensor) -> Tensor:
        """The branch's map."""
        return self.head(correlate(self.conv_search(search), self.conv_kernel(template)))


class Head(nn.Module):
    """Region proposals."""

    def __init__(self) -> None:
        super().__init__()
        self.cls, self.loc = Branch(2 * ANCHORS), Branch(4 * ANCHORS)

    def forward(self, search: Tensor, template: Tensor) -> tuple[Tensor, Tensor]:
        """Cls and loc."""
        return self.cls(search, template), self.loc(search, template)


class Peer(nn.Module):
    """The network; features of the template are kept from frame to frame."""

    def __init__(self) -> None:
        super().__init__()
        self.backbone = Backbone()
        self.rpn_head = Head()

    def embed(self, template: Tensor) -> Tensor:
        """Once a sequence: what is kept of the template crop."""
        return self.backbone(template)

    def match(self, features: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """Once a frame."""
        return self.rpn_head(self.backbone(search), features)

    def forward(self, template: Tensor, search: Tensor) -> tuple[Tensor, Tensor]:
        """Cls and loc of crops (1, 3, 127, 127) and (1, 3, 287, 287)."""
        return self.match(self.embed(template), search)


def build() -> nn.Module:
    """The network in eval mode, with the official checkpoint's keys."""
    return Peer().eval()
