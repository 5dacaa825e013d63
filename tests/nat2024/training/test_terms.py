"""What somebody else's loss may return: terms by name that weights have a part in, or one line."""

import pytest
import torch
from torch import nn

from nat2024.errors import TrainingFailed
from nat2024.training import TrainingSettings, train
from nat2024.training.terms import find_bad, numbers_of, sum_terms


class Ones:
    steps_per_epoch = 2

    def draw(self, _step):
        return {"x": torch.ones(3, 2)}


BAD = {
    "a tensor": (lambda y: y.mean(), r"returned a Tensor of shape \(\); return its terms by name"),
    "nothing": (lambda _y: None, "returned a NoneType; return its terms by name"),
    "no term": (lambda _y: {}, "no terms; return at least one"),
    "a number": (lambda _y: {"level": 3.0}, "term 'level' is a float; a term is a tensor of one"),
    "a map": (lambda y: {"level": y}, r"term 'level' is a Tensor of shape \(3, 1\)"),
    "detached": (lambda y: {"a": y.detach().mean()}, r"the loss \(a\) depends on no weight"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_loss_of_another_form_is_one_line(case, tmp_path):
    made, message = BAD[case]
    network = nn.Linear(2, 1)
    with pytest.raises(TrainingFailed, match=message):
        train(
            network, lambda batch: made(network(batch["x"])), Ones(), TrainingSettings(), tmp_path
        )


def test_terms_add_up_and_the_first_bad_one_is_named():
    weight = torch.tensor(2.0, requires_grad=True)
    terms = {"a": 3 * weight, "b": torch.ones(1), "c": weight.reshape(1, 1)}
    total = sum_terms(terms)
    assert total.shape == ()
    assert numbers_of(terms, total) == {"a": 6.0, "b": 1.0, "c": 2.0, "loss": 9.0}
    total.backward()
    assert weight.grad == 4
    assert find_bad({"a": 1.0, "b": float("inf"), "c": float("nan")}) == "loss term 'b' is inf"
    assert not find_bad({"a": 1.0})
