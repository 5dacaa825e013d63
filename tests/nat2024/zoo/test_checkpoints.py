"""Checkpoints in all published forms load; broken, foreign and hostile ones are refused."""

import io
import pickle
import zipfile

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from safetensors.torch import save_file

from nat2024.errors import WeightsMismatch, WeightsMissing, WrongNetwork
from nat2024.zoo import fit_state_dict, read_checkpoint


@pytest.fixture
def state():
    return {
        "conv.weight": torch.arange(6.0).reshape(2, 3),
        "bn.num_batches_tracked": torch.tensor(7),
        "conv.bias": torch.tensor([0.5, -0.5]),
    }


def assert_equal(actual, expected):
    assert list(actual) == list(expected)
    for key, value in expected.items():
        assert actual[key].dtype == value.dtype
        assert torch.equal(actual[key], value), key


def prefixed(state):
    return {f"module.{key}": value for key, value in state.items()}


FORMS = {
    "plain": lambda state: state,
    "wrapped": lambda state: {"state_dict": state},
    "wrapped with other content": lambda state: {
        "epoch": 20,
        "arch": "alexnet",
        "best": None,
        "state_dict": state,
        "optimizer": {"param_groups": [{"lr": 0.005, "betas": (0.9, 0.999)}]},
    },
    "prefix": prefixed,
    "wrapped prefix": lambda state: {"state_dict": prefixed(state)},
    "numpy scalars": lambda state: {
        "state_dict": state,
        "optimizer": {"lr": np.float64(0.1), "step": np.int64(3), "eps": np.float32(1e-8)},
    },
}


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "before zip"])
@pytest.mark.parametrize("form", list(FORMS))
def test_every_wrapper_form_gives_the_state_dict(tmp_path, state, form, zipped):
    path = tmp_path / "model.pth"
    torch.save(FORMS[form](state), path, _use_new_zipfile_serialization=zipped)
    assert_equal(read_checkpoint(path), state)
    assert_equal(read_checkpoint(str(path)), state)


@pytest.mark.parametrize("prefix", ["", "module."])
def test_safetensors_files_load(tmp_path, state, prefix):
    path = tmp_path / "model.safetensors"
    save_file({prefix + key: value for key, value in state.items()}, path)
    assert_equal(dict(sorted(read_checkpoint(path).items())), dict(sorted(state.items())))


def test_only_a_leading_prefix_is_taken_off(tmp_path):
    path = tmp_path / "model.pth"
    torch.save({"block.module.weight": torch.ones(1), "module.x": torch.ones(1)}, path)
    assert list(read_checkpoint(path)) == ["block.module.weight", "x"]


def test_what_is_no_tensor_is_left_out(tmp_path, state):
    path = tmp_path / "model.pth"
    torch.save({**state, "epoch": 3, "name": "net"}, path)
    assert_equal(read_checkpoint(path), state)


def test_an_absent_file_is_named(tmp_path):
    with pytest.raises(WeightsMissing, match=r"absent\.pth: no such weights file"):
        read_checkpoint(tmp_path / "absent.pth")
    with pytest.raises(WeightsMismatch, match="is a folder; name the checkpoint file in it"):
        read_checkpoint(tmp_path)


class Hostile:
    """Writes a file when it is unpickled with full trust."""

    def __init__(self, target):
        self.target = target

    def __reduce__(self):
        return (exec, (f"open({str(self.target)!r}, 'w').write('run')",))


@pytest.mark.parametrize("container", ["zip", "before zip", "pickle", "wrapped"])
def test_code_in_a_pickle_is_refused_and_does_not_run(tmp_path, state, container):
    path, target = tmp_path / "hostile.pth", tmp_path / "ran"
    content = {**state, "extra": Hostile(target)}
    if container == "pickle":
        path.write_bytes(pickle.dumps({"extra": Hostile(target)}, protocol=2))
    elif container == "wrapped":
        torch.save({"state_dict": state, "optimizer": Hostile(target)}, path)
    else:
        torch.save(content, path, _use_new_zipfile_serialization=container == "zip")
    with pytest.raises(WeightsMismatch, match=r"hostile\.pth: refused"):
        read_checkpoint(path)
    assert not target.exists()
    # The same file does run its code where it is trusted, so the test would notice.
    load_trusting(path, container)
    assert target.read_text() == "run"


def load_trusting(path, container):
    if container == "pickle":
        pickle.loads(path.read_bytes())
    else:
        torch.load(path, weights_only=False)


def test_a_whole_pickled_network_is_refused(tmp_path):
    path = tmp_path / "network.pth"
    torch.save(torch.nn.Linear(2, 2), path)
    with pytest.raises(WeightsMismatch, match="refused, it holds more than tensors"):
        read_checkpoint(path)


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "before zip"])
@pytest.mark.parametrize("kept", [0.0, 0.02, 0.3, 0.9, 0.995])
def test_a_truncated_file_is_refused(tmp_path, kept, zipped):
    path = tmp_path / "cut.pth"
    torch.save({"weight": torch.zeros(400)}, path, _use_new_zipfile_serialization=zipped)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * kept)])
    with pytest.raises(WeightsMismatch, match=r"cut\.pth: "):
        read_checkpoint(path)


@pytest.mark.parametrize("kept", [0.1, 0.9])
def test_a_truncated_safetensors_file_is_refused(tmp_path, kept):
    path = tmp_path / "cut.safetensors"
    save_file({"weight": torch.zeros(400)}, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * kept)])
    with pytest.raises(WeightsMismatch, match="not a readable safetensors file"):
        read_checkpoint(path)


@pytest.mark.parametrize("ending", ["pth", "safetensors"])
def test_an_empty_file_is_named_so(tmp_path, ending):
    path = tmp_path / f"empty.{ending}"
    path.touch()
    with pytest.raises(WeightsMismatch, match=f"empty.{ending}: is an empty file"):
        read_checkpoint(path)


def test_a_text_is_refused_without_the_words_of_the_unpickler(tmp_path):
    path = tmp_path / "text.pth"
    path.write_text("hello\nworld\n")
    with pytest.raises(WeightsMismatch, match=r"text\.pth: not a readable PyTorch checkpoint$"):
        read_checkpoint(path)


@pytest.mark.parametrize("content", [{}, [], 3, {"state_dict": {}}, {"epoch": 3}, torch.ones(2)])
def test_a_file_without_a_state_dict_is_refused(tmp_path, content):
    path = tmp_path / "other.pth"
    torch.save(content, path)
    with pytest.raises(WeightsMismatch, match="holds no state dict"):
        read_checkpoint(path)


def test_a_zip_archive_of_something_else_is_refused(tmp_path):
    path = tmp_path / "archive.pth"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(WeightsMismatch, match="not a readable PyTorch checkpoint"):
        read_checkpoint(path)


def refusal(path):
    """The message that refuses a file, empty where it is read."""
    try:
        assert isinstance(read_checkpoint(path), dict)
    except WeightsMismatch as error:
        return str(error)
    return ""


@given(content=st.binary(max_size=200))
def test_any_bytes_are_refused_with_one_line(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "any.pth"
    path.write_bytes(content)
    with pytest.raises(WeightsMismatch) as caught:
        read_checkpoint(path)
    assert "\n" not in str(caught.value)


@given(place=st.floats(0, 1, exclude_max=True), value=st.integers(0, 255))
def test_one_changed_byte_never_gives_another_error(tmp_path_factory, place, value):
    stream = io.BytesIO()
    torch.save({"weight": torch.zeros(3)}, stream, _use_new_zipfile_serialization=False)
    content = bytearray(stream.getvalue())
    content[int(place * len(content))] = value
    path = tmp_path_factory.mktemp("changed") / "changed.pth"
    path.write_bytes(bytes(content))
    assert "\n" not in refusal(path)


def test_a_pickle_stopped_anywhere_never_gives_another_error(tmp_path):
    # Torch itself lets IndexError, AssertionError, TypeError and struct.error out of such files.
    stream = io.BytesIO()
    torch.save({"weight": torch.zeros(3)}, stream, _use_new_zipfile_serialization=False)
    content, refusals = stream.getvalue(), []
    path = tmp_path / "changed.pth"
    for place in range(len(content)):
        path.write_bytes(content[:place] + b"." + content[place + 1 :])
        refusals.append(refusal(path))
    assert sum(map(bool, refusals)) > len(content) / 4
    assert not any("\n" in message for message in refusals)


def test_fitting_keeps_what_the_network_expects(state):
    expected = {key: torch.zeros_like(value) for key, value in state.items()}
    fitting = fit_state_dict({**state, "unused": torch.ones(1)}, expected, "file")
    assert_equal(fitting, state)


def test_missing_counters_and_optional_entries_are_allowed(state):
    weights = {"conv.weight": state["conv.weight"]}
    assert list(fit_state_dict(weights, state, "file", optional=["conv.bias"])) == ["conv.weight"]
    with pytest.raises(WeightsMismatch, match=r"file: .* 1 of 3 entries are missing \(conv.bias\)"):
        fit_state_dict(weights, state, "file")


def test_bare_backbones_get_their_prefix(state):
    expected = {f"features.{key}": value for key, value in state.items()}
    assert_equal(fit_state_dict(state, expected, "file"), expected)


def test_another_network_is_described(state):
    other = {f"net.{n}": torch.zeros(1) for n in range(5)}
    with pytest.raises(WrongNetwork) as caught:
        fit_state_dict(other, state, "file.pth")
    assert caught.value.entries == {f"net.{n} (1,)" for n in range(5)}
    assert str(caught.value) == (
        "file.pth: not a checkpoint of this network: 2 of 3 entries are missing "
        "(conv.weight, conv.bias), 5 are unknown (net.0, net.1, net.2, ...)"
    )


UNUSABLE = {
    "int32, expected plain float32": lambda value: value.int(),
    "complex64, expected plain float32": lambda value: value.to(torch.complex64),
    "sparse_coo, expected plain float32": lambda value: value.to_sparse(),
    r"no numbers \(a tensor of the device meta\)": lambda value: value.to("meta"),
}


@pytest.mark.parametrize("message", UNUSABLE)
def test_entries_that_are_no_plain_numbers_are_named(state, message):
    wrong = {**state, "conv.bias": UNUSABLE[message](state["conv.bias"])}
    with pytest.raises(WeightsMismatch, match=rf"file\.pth: conv\.bias holds {message}"):
        fit_state_dict(wrong, state, "file.pth")


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_refused(state, number):
    wrong = {**state, "conv.bias": torch.tensor([0.5, number])}
    with pytest.raises(WeightsMismatch, match=r"file\.pth: conv\.bias holds .* not finite"):
        fit_state_dict(wrong, state, "file.pth")


@pytest.mark.parametrize("dtype", [torch.float64, torch.float16, torch.bfloat16])
def test_other_precisions_of_floats_are_taken(state, dtype):
    given = {**state, "conv.bias": state["conv.bias"].to(dtype)}
    assert_equal(fit_state_dict(given, state, "file.pth"), given)


def test_other_shapes_are_described(state):
    wrong = {**state, "conv.bias": torch.zeros(3)}
    with pytest.raises(WeightsMismatch, match=r"conv.bias is \(3,\), expected \(2,\)"):
        fit_state_dict(wrong, state, "file.pth")
