"""The conformance suite finds every way in which an enhancer can break its contract."""

import numpy as np
import pytest
import torch

from nat2024.cards import Card
from nat2024.errors import BrokenPlugin
from nat2024.images import check_batch
from nat2024.interfaces import Enhancer
from nat2024.testing import check_enhancer
from nat2024.testing.enhancers import night_image


class Halved(Enhancer):
    """Keeps the contract; every class below breaks one part of it."""

    name = "halved"
    card = Card(title="Halved", summary="Halves all values.")

    def enhance_batch(self, batch):
        check_batch(batch)
        return self.compute(batch)

    def compute(self, batch):
        return batch * 0.5


class FloatImage(Halved):
    def enhance(self, image, *, bgr=False):
        return super().enhance(image, bgr=bgr) / 255.0


class PaddedImage(Halved):
    def enhance(self, image, *, bgr=False):
        return np.pad(super().enhance(image, bgr=bgr), ((0, 1), (0, 0), (0, 0)))


class ModifiedImage(Halved):
    def enhance(self, image, *, bgr=False):
        answer = super().enhance(image, bgr=bgr)
        image //= 2
        return answer


class DoubleBatch(Halved):
    def compute(self, batch):
        return batch.double()


class CutBatch(Halved):
    # Only the batch: images keep their size because `enhance` is another one.
    def enhance(self, image, *, bgr=False):
        return Halved().enhance(image, bgr=bgr)

    def compute(self, batch):
        return batch[..., : batch.shape[-1] // 16 * 16 or 1]


class ModifiedBatch(Halved):
    def compute(self, batch):
        return batch.mul_(0.5)


class TooBright(Halved):
    def compute(self, batch):
        return batch + 0.5


class NotANumber(Halved):
    def compute(self, batch):
        return batch / batch.min() * 0


class Wavering(Halved):
    calls = 0

    def compute(self, batch):
        self.calls += 1
        return batch * (0.5 if self.calls % 2 else 0.25)


class RedOnly(Halved):
    def enhance(self, image, *, bgr=False):
        return super().enhance(image, bgr=False)

    def compute(self, batch):
        return batch * torch.tensor([0.5, 1.0, 1.0]).reshape(1, 3, 1, 1)


class TwoMethods(Halved):
    def enhance(self, image, *, bgr=False):
        return super().enhance(image, bgr=bgr) // 2


class BatchMean(Halved):
    def compute(self, batch):
        return batch * batch.mean()


class FirstOfBatch(Halved):
    def compute(self, batch):
        return batch[:1] * 0.5


class AnyImage(Halved):
    def enhance(self, image, *, bgr=False):
        if np.ndim(image) == 2:
            return image
        return super().enhance(image, bgr=bgr)


class CrashingImage(Halved):
    def enhance(self, image, *, bgr=False):
        assert len(image[0][0]) >= 3
        return super().enhance(image, bgr=bgr)


class AnyBatch(Enhancer):
    card = Halved.card

    def enhance_batch(self, batch):
        return batch * 0.5


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (FloatImage, "must answer an image of 1x1 with a uint8 array, not float64"),
        (PaddedImage, r"answers an image of 1x1 with the shape \(2, 1, 3\)"),
        (ModifiedImage, "modifies its input, an image"),
        (DoubleBatch, "must answer a batch with a float32 tensor, not torch.float64"),
        (CutBatch, r"answers a batch of the shape \(1, 3, 1, 7\) with the shape \(1, 3, 1, 1\)"),
        (ModifiedBatch, "modifies its input, a batch"),
        (TooBright, r"leaves 0\.\.1"),
        (NotANumber, r"leaves 0\.\.1: .* becomes nan"),
        (Wavering, "is not deterministic"),
        (RedOnly, "ignores bgr=True"),
        (TwoMethods, "is inconsistent: enhance and enhance_batch disagree by"),
        (BatchMean, "mixes a batch of two: it differs from single answers"),
        (FirstOfBatch, "mixes a batch of two: its answer has the shape"),
        (AnyImage, "must refuse an image without channels with ArrayContract, but takes it"),
        (
            CrashingImage,
            "refuse an image without channels .* but raises TypeError",
        ),
        (AnyBatch, "must refuse a uint8 batch with ArrayContract, but takes it"),
    ],
)
def test_a_broken_contract_is_found(broken, message):
    with pytest.raises(BrokenPlugin, match=message):
        check_enhancer(broken())


def test_a_kept_contract_passes():
    check_enhancer(Halved())


def test_networks_that_see_bgr_images_pass():
    class SeesBgr(Halved):
        def enhance(self, image, *, bgr=False):
            return super().enhance(image, bgr=not bgr)

        def compute(self, batch):
            return batch * torch.tensor([0.5, 0.75, 1.0]).reshape(1, 3, 1, 1)

    check_enhancer(SeesBgr())


def test_raw_output_may_leave_the_range():
    class Raw(TooBright):
        clamp = False

    check_enhancer(Raw())


def test_what_is_not_repeatable_is_not_compared():
    class Random(Wavering):
        card = Card(title="Random", summary="Varies.", repeatable=False)

    check_enhancer(Random())


@pytest.mark.parametrize("size", [(1, 1), (37, 53)])
def test_night_images_are_dark_and_always_the_same(size):
    image = night_image(*size)
    assert image.shape == (*size, 3)
    assert image.dtype == np.uint8
    assert np.array_equal(image, night_image(*size))
    if size != (1, 1):
        assert image.mean() < 80
        assert image.max() > 200
