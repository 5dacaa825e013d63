"""Base classes: an author writes one method, and gets the others."""

from typing import Any

import cv2
import numpy as np
import pytest
import torch

import nat2024
from nat2024.cards import Card
from nat2024.errors import ArrayContract, InvalidOption, OutOfMemory
from nat2024.interfaces import Enhancer, Tracker, check_start_box

IMAGE = np.random.default_rng(0).integers(0, 256, (11, 7, 3), dtype=np.uint8)


class Halves(Enhancer):
    """Written as a batch."""

    card = Card(title="Halves", summary="")

    def enhance_batch(self, batch: Any) -> Any:
        return batch / 2


class Inverts(Enhancer):
    """Written as an image; channel 0 stays, so that the order shows."""

    card = Card(title="Inverts", summary="")

    def enhance(self, image: Any, *, bgr: bool = False) -> Any:
        out = 255 - image
        channel = 2 if bgr else 0
        out[..., channel] = image[..., channel]
        return out


def test_enhance_follows_from_enhance_batch() -> None:
    expected = IMAGE / 2
    np.testing.assert_allclose(Halves().enhance(IMAGE), expected, atol=1)
    assert Halves().enhance(IMAGE).dtype == np.uint8


def test_enhance_batch_follows_from_enhance_in_the_order_given() -> None:
    batch = torch.from_numpy(IMAGE.transpose(2, 0, 1).copy())[None] / 255
    got = Inverts().enhance_batch(batch.repeat(2, 1, 1, 1))
    assert got.shape == (2, 3, 11, 7)
    torch.testing.assert_close(got[1, 0], batch[0, 0])
    torch.testing.assert_close(got[1, 1:], 1 - batch[0, 1:])


def test_an_enhancer_without_either_is_refused() -> None:
    with pytest.raises(TypeError, match="must define enhance or enhance_batch"):
        type("Nothing", (Enhancer,), {})


def test_an_enhancer_without_maps_has_none() -> None:
    assert Halves().maps(torch.zeros(1, 3, 4, 4)) == {}
    with pytest.raises(ArrayContract):
        Halves().maps(torch.zeros(3, 4, 4))


class Sees(Tracker):
    """Keeps the mean of what it sees."""

    card = Card(title="Sees", summary="", scopes=("patch", "frame"))

    def start(self, image: Any, box: Any) -> Any:
        self.seen = [image.mean()]
        return box

    def advance(self, image: Any) -> Any:
        self.seen.append(image.mean())
        return np.zeros(4), 0.0


@pytest.mark.parametrize(("scope", "factor"), [("patch", 1.0), ("frame", 0.5)])
def test_only_the_frame_scope_enhances_frames(scope: Any, factor: float) -> None:
    tracker = Sees(enhancer=Halves(), scope=scope)
    tracker.init(IMAGE, [1, 1, 3, 3])
    tracker.update(IMAGE)
    np.testing.assert_allclose(tracker.seen, [IMAGE.mean() * factor] * 2, atol=0.3)


def test_any_object_with_enhance_batch_is_an_enhancer() -> None:
    class Foreign:
        def enhance_batch(self, batch: Any) -> Any:
            return batch * 0

    tracker = Sees(enhancer=Foreign(), scope="frame")
    tracker.init(IMAGE, [1, 1, 3, 3])
    assert tracker.seen == [0]


def test_the_default_scope_is_the_first_of_the_card() -> None:
    assert Sees().scope == "patch"

    class FrameOnly(Sees):
        name = "frame_only"
        card = Card(title="", summary="", scopes=("frame",))

    assert FrameOnly().scope == "frame"
    with pytest.raises(InvalidOption, match="frame_only takes only scope=frame, not patch"):
        FrameOnly(scope="patch")


@pytest.mark.parametrize(
    ("box", "told"),
    [
        ([1, 2, 0, 4], "has no area"),
        ([1, 2, 3, -4], "has no area"),
        ([1, 2, 3], "must be four finite numbers"),
        ("abcd", "must be four finite numbers x, y, w, h, not 'abcd'"),
        ([1, 2, float("nan"), 4], "must be four finite numbers"),
        ([1, 2, float("inf"), 4], "must be four finite numbers"),
        ([7, 2, 3, 4], "lies outside the 7x11 image"),
        ([-3, 2, 3, 4], "lies outside the 7x11 image"),
    ],
)
def test_boxes_that_no_tracker_can_start_on(box: list[float], told: str) -> None:
    with pytest.raises(ArrayContract, match=told):
        check_start_box(box, IMAGE)


def test_a_start_box_that_touches_the_image_is_kept_as_it_is() -> None:
    given_box = np.array([-2.5, 10.5, 3.0, 8.0])
    got = check_start_box(given_box, IMAGE)
    assert got.tolist() == given_box.tolist()
    assert got is not given_box


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4), np.uint8),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((4, 4, 3), np.float32),
        [[0]],
    ],
)
def test_what_is_no_image(image: Any) -> None:
    with pytest.raises(ArrayContract, match="image must"):
        Halves().enhance(image)
    with pytest.raises(ArrayContract, match="image must"):
        Sees().init(image, [0, 0, 2, 2])


SIGNS = [
    MemoryError(),
    RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 3 bytes"),
    cv2.error("OpenCV(5.0.0) alloc.cpp:73: error: (-4:Insufficient memory) Failed to allocate"),
]


@pytest.mark.parametrize("error", SIGNS, ids=["python", "torch", "opencv"])
def test_lack_of_memory_is_told_in_one_line(error: Exception) -> None:
    class Fails(Halves):
        name = "fails"

        def enhance_batch(self, batch: Any) -> Any:
            raise error

    for call in (
        lambda: Fails().enhance(IMAGE),
        lambda: Sees(enhancer=Fails(), scope="frame").init(IMAGE, [1, 1, 3, 3]),
    ):
        with pytest.raises(OutOfMemory, match=r"^fails: not enough memory for a 7x11 image; .*$"):
            call()


@pytest.mark.parametrize("name", ["gamma", "ldenhancer", "lime"])
def test_images_that_do_not_become_batches_are_told(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    enhancer = nat2024.create_enhancer(name, **({"weights": False} if name == "ldenhancer" else {}))

    def fails(*_: Any, **__: Any) -> Any:
        raise SIGNS[1]

    monkeypatch.setattr(torch, "from_numpy", fails)
    with pytest.raises(OutOfMemory, match=f"{name}: not enough memory for a 7x11 image"):
        enhancer.enhance(IMAGE)


def test_other_failures_are_not_called_lack_of_memory() -> None:
    class Fails(Halves):
        def enhance_batch(self, batch: Any) -> Any:
            msg = "something else"
            raise RuntimeError(msg)

    with pytest.raises(RuntimeError, match="something else"):
        Fails().enhance(IMAGE)


def test_an_enhancer_that_changes_the_shape_is_told() -> None:
    class Narrows:
        def enhance_batch(self, batch: Any) -> Any:
            return batch[..., :-1]

    with pytest.raises(ArrayContract, match="it must keep the shape"):
        Sees(enhancer=Narrows(), scope="frame").init(IMAGE, [1, 1, 3, 3])


def test_what_a_network_gives_may_enter_training() -> None:
    enhancer = nat2024.create_enhancer("ldenhancer", weights=False)
    out = enhancer.enhance_batch(torch.rand(1, 3, 16, 16))
    layer = torch.nn.Conv2d(3, 1, 1)
    layer(out).sum().backward()
    assert layer.weight.grad is not None


def test_an_enhancer_that_gives_no_tensor_is_told() -> None:
    class GivesArrays:
        def enhance_batch(self, batch: Any) -> Any:
            return batch.numpy()

    with pytest.raises(ArrayContract, match="must give a tensor, not ndarray"):
        Sees(enhancer=GivesArrays(), scope="frame").init(IMAGE, [1, 1, 3, 3])


def test_a_foreign_network_with_gradients_may_enhance_frames() -> None:
    class Network:
        weight = torch.nn.Parameter(torch.ones(1))

        def enhance_batch(self, batch: Any) -> Any:
            return batch * self.weight

    tracker = Sees(enhancer=Network(), scope="frame")
    tracker.init(IMAGE, [1, 1, 3, 3])
    assert tracker.seen[0] == IMAGE.mean()


def test_a_start_box_from_an_array_is_told_as_numbers() -> None:
    with pytest.raises(ArrayContract, match=r"x, y, w, h, not \[nan, 0.0, 5.0, 5.0\]$"):
        Sees().init(IMAGE, np.array([np.nan, 0, 5, 5]))
