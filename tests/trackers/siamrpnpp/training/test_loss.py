import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024_trackers.siamese.state import Constants
from nat2024_trackers.siamrpnpp.anchors import AnchorDecoder, anchor_boxes
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN
from nat2024_trackers.siamrpnpp.training.checks import check_pairs
from nat2024_trackers.siamrpnpp.training.loss import WEIGHTS, pair_terms
from nat2024_trackers.siamrpnpp.training.pairs import Pair
from nat2024_trackers.siamrpnpp.training.recipe import PairLoss
from nat2024_trackers.siamrpnpp.training.settings import PairSettings
from nat2024_trackers.siamrpnpp.training.targets import assign

CONSTANTS = Constants(191, 9, 8, 0.0, 0.0, 0.0)
ANCHORS = torch.from_numpy(anchor_boxes(CONSTANTS))


@settings(max_examples=50, deadline=None)
@given(
    st.floats(-32, 32),
    st.floats(-32, 32),
    st.floats(20, 150),
    st.floats(20, 150),
)
def test_the_decoder_gives_back_what_was_assigned(x, y, width, height):
    boxes = torch.tensor([[x, y, width, height]])
    assigned = assign(boxes, ANCHORS)
    assert assigned.positive.any()
    assert not (assigned.positive & assigned.negative).any()
    found = AnchorDecoder(CONSTANTS)(
        (np.zeros((1, 10, 9, 9), np.float32), assigned.offsets.reshape(1, 20, 9, 9).numpy())
    )
    wanted = np.broadcast_to(boxes.numpy()[0][:, None], found.boxes[0].shape)
    np.testing.assert_allclose(found.boxes[0], wanted, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("zoom", [0.6, 1.0, 1.6])
def test_anchors_are_assigned_by_place_and_shape_not_by_size(zoom):
    size = 64.0 * zoom
    assigned = assign(torch.tensor([[0.0, 0, size, size]]), ANCHORS)
    square = assigned.positive.reshape(5, 9, 9)[2]
    assert square[4, 4]
    rows, columns = square.nonzero().T
    assert rows.float().mean() == columns.float().mean() == 4
    # an anchor of the target's size may be off by a quarter of it
    assert (rows - 4).abs().max() * 8 <= 0.26 * size
    aside = assign(torch.tensor([[24.0, 24, size, size]]), ANCHORS)
    assert aside.negative.reshape(5, 9, 9)[2, 0, 0]


def test_a_target_that_is_absent_makes_every_anchor_negative(network):
    batch = a_batch()
    batch["box"][1] = torch.nan
    assigned = assign(batch["box"], ANCHORS)
    assert assigned.positive[0].any()
    assert not assigned.positive[1].any()
    assert assigned.negative[1].all()
    assert assigned.offsets.isfinite().all()
    terms = pair_terms(network.train(), batch, ANCHORS)
    assert all(term.isfinite() for term in terms.values())
    batch["box"][0] = torch.nan
    assert pair_terms(network, batch, ANCHORS)["box"] == 0


def a_batch(count=2, search=191):
    generator = torch.Generator().manual_seed(1)
    return {
        "template": torch.rand(count, 3, 127, 127, generator=generator) * 255,
        "search": torch.rand(count, 3, search, search, generator=generator) * 255,
        "box": torch.tensor([[4.0, -6, 60, 70], [-12, 3, 90, 40]])[:count],
    }


@pytest.fixture
def network():
    torch.manual_seed(5)
    return CompactSiamRPN()


def test_terms_of_fresh_weights_are_those_of_a_coin(network):
    terms = pair_terms(network.train(), a_batch(), ANCHORS)
    assert list(terms) == list(WEIGHTS)
    for name in ("positive", "negative", "cross"):
        assert terms[name].item() == pytest.approx(np.log(2), abs=0.2)


def test_every_weight_gets_a_gradient(network):
    loss = PairLoss(network.train(), PairSettings(precision="float32"))
    sum(loss(a_batch()).values()).backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().sum() > 0, name


def test_half_precision_is_near(network):
    exact = PairLoss(network.train(), PairSettings(precision="float32"))(a_batch())
    half = PairLoss(network.train(), PairSettings(precision="bfloat16"))(a_batch())
    for name, term in exact.items():
        assert half[name].dtype == torch.float32
        assert half[name].item() == pytest.approx(term.item(), rel=0.05), name


def test_a_few_steps_learn_two_pairs(network):
    batch = a_batch()
    loss = PairLoss(network.train(), PairSettings(precision="float32"))
    optimiser = torch.optim.AdamW(network.parameters(), 2e-3)
    sums = []
    for _ in range(8):
        terms = loss(batch)
        total = sum(terms.values())
        optimiser.zero_grad()
        total.backward()
        optimiser.step()
        sums.append(total.item())
    assert sums[-1] < 0.8 * sums[0]


class Knowing(CompactSiamRPN):
    """Answers with the assumed size, or with the true one, at the right place."""

    def __init__(self, boxes, *, measures):
        super().__init__()
        self.boxes, self.measures = boxes, measures

    def forward(self, template, search):
        given = self.boxes.clone()
        if not self.measures:
            given[:, 2:] = 64.0
        assigned = assign(given, ANCHORS)
        best = assigned.positive.float().reshape(len(given), 5, 9, 9)
        classes = torch.cat([1 - best, best], dim=1) * 9
        return classes, assigned.offsets.reshape(len(given), 20, 9, 9)


@pytest.mark.parametrize("measures", [True, False])
def test_the_size_slope_tells_measuring_from_assuming(measures):
    rng = np.random.default_rng(1)
    sizes = 64 * np.exp(rng.uniform(-0.5, 0.5, size=16))
    boxes = np.column_stack([rng.uniform(-20, 20, size=(16, 2)), sizes, sizes])
    blank = np.zeros((127, 127, 3), np.uint8), np.zeros((191, 191, 3), np.uint8)
    network = Knowing(torch.from_numpy(boxes).float(), measures=measures).eval()
    check = check_pairs(network, [Pair(*blank, box) for box in boxes])
    assert check.slope == pytest.approx(1.0 if measures else 0.0, abs=0.01)
    assert check.found == 1.0
    if measures:
        assert check.overlap == pytest.approx(1.0, abs=1e-4)
        assert check.bias == pytest.approx(1.0, abs=1e-4)
