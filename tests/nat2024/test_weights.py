"""Weights that are registered once are found, checked and kept apart from then on."""

import json
import os
import shutil

import pytest
import torch
from safetensors.torch import load_file, save_file
from torch import nn

import nat2024
from nat2024 import NeuralEnhancer, register_enhancer, registry
from nat2024.cards import Card, NetworkFacts, WeightsFile
from nat2024.engine import combine
from nat2024.engine.plan import plugin_record
from nat2024.errors import (
    InvalidOption,
    Unwritable,
    UsageError,
    WeightsMismatch,
    WeightsMissing,
)
from nat2024.weights import (
    describe_weights_at_hand,
    import_weights,
    list_weights,
    remove_weights,
    verify_weights,
)
from nat2024.zoo import sha256_of


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path / "registered"))
    return tmp_path / "registered"


class Small(NeuralEnhancer):
    """One convolution; the variant says how large."""

    card = Card(
        title="Small",
        summary="For tests.",
        needs_weights=True,
        parameters=12,
        variant="three",
        keys=("conv.weight (3, 3, 1, 1)",),
        variants=(NetworkFacts(variant="five", parameters=78, keys=("conv.weight (3, 3, 5, 5)",)),),
    )

    def __init__(self, *, variant=None, strength: float = 1.0, **base):
        self.variant = variant or "three"
        self.strength = strength
        super().__init__(**base)

    def build(self):
        size = {"three": 1, "five": 5}[self.variant]
        model = nn.Module()
        model.conv = nn.Conv2d(3, 3, size, padding=size // 2)
        model.again = model.conv  # one tensor under two names, as official networks have
        return model

    def forward(self, batch):
        return self.model.conv(batch) * self.strength


Small.__init__.__annotations__["variant"] = str | None


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(registry, "_registered", dict(registry._registered))
    register_enhancer("small")(Small)
    return "small"


@pytest.fixture
def checkpoint(tmp_path, small):
    """Makes a checkpoint of a variant as authors wrap it."""

    def make(variant="three", name="model.pth", seed=1):
        torch.manual_seed(seed)
        state = nat2024.create_enhancer(small, weights=False, variant=variant).model.state_dict()
        wrapped = {"state_dict": {f"module.{key}": value for key, value in state.items()}}
        torch.save({**wrapped, "epoch": 3}, tmp_path / name)
        return tmp_path / name, state

    return make


def test_a_checkpoint_is_converted_and_found_from_then_on(checkpoint, folder):
    path, state = checkpoint()
    entry = import_weights("small", path)
    assert (entry.form, entry.entries, entry.options) == ("safetensors", 4, {"variant": "three"})
    assert entry.source_sha256 == sha256_of(path)
    assert entry.sha256 == sha256_of(entry.path)
    assert entry.path.parent == folder / "small"
    stored = load_file(entry.path)
    assert set(stored) == set(state)
    path.unlink()  # the original is not needed any more
    created = nat2024.create_enhancer("small")
    for key, value in created.model.state_dict().items():
        assert torch.equal(value, state[key]), key
    assert created.weights.origin == "registered"
    assert created.weights.path == entry.path
    assert created.weights.sha256 == entry.source_sha256


def test_a_given_path_and_false_are_stronger(checkpoint):
    import_weights("small", checkpoint()[0])
    other, state = checkpoint(name="other.pth", seed=2)
    assert nat2024.create_enhancer("small", weights=False).weights.origin == "fresh"
    given = nat2024.create_enhancer("small", weights=other)
    assert given.weights.origin == "given"
    assert torch.equal(given.model.conv.weight, state["conv.weight"])


def test_a_published_file_stays_known(checkpoint, monkeypatch):
    path, _ = checkpoint()
    file = WeightsFile("Epoch9.pth", "somewhere", "none stated", sha256=sha256_of(path))
    monkeypatch.setattr(Small, "card", Card(title="Small", summary="", weights=(file,)))
    assert import_weights("small", path).known_as == "Epoch9.pth"
    assert nat2024.create_enhancer("small").weights.known_as == "Epoch9.pth"
    assert describe_weights_at_hand("small", Small.card) == "registered: Epoch9.pth"
    monkeypatch.setattr(Small, "card", Card(title="Small", summary=""))
    assert nat2024.create_enhancer("small").weights.known_as == "Epoch9.pth"


def test_the_variant_of_a_published_file_is_taken_from_its_card(checkpoint, monkeypatch):
    path, _ = checkpoint("five")
    note = "variant five, the large one"
    file = WeightsFile("five.pt", "somewhere", "none stated", sha256=sha256_of(path), note=note)
    monkeypatch.setattr(Small, "card", Card(title="Small", summary="", weights=(file,)))
    with pytest.raises(WeightsMismatch, match=r"model.pth: is five.pt of variant five, not of thr"):
        import_weights("small", path, {"variant": "three"})
    assert import_weights("small", path).options == {"variant": "five"}


def test_registered_weights_imply_their_options(checkpoint):
    import_weights("small", checkpoint("five")[0], {"variant": "five", "strength": "0.5"})
    created = nat2024.create_enhancer("small")
    assert (created.variant, created.strength) == ("five", 0.5)
    assert created.weights.options == {"variant": "five", "strength": 0.5}
    with pytest.raises(WeightsMissing, match=r"registered are only those for strength=0.5, var"):
        nat2024.create_enhancer("small", strength=2.0)
    with pytest.raises(WeightsMissing, match=r"no weights for small.*weights import small FILE"):
        nat2024.create_enhancer("small", variant="three")


def test_the_manifest_has_the_implied_options(checkpoint):
    import_weights("small", checkpoint("five")[0], {"variant": "five", "strength": 0.5})
    (combination,) = combine(["mil"], ["small"])
    tracker, enhancer = combination.create()
    record = plugin_record(combination.enhancer, enhancer)
    assert record.options["variant"] == "five"
    assert record.options["strength"] == 0.5
    assert record.weights.origin == "registered"
    del tracker


def test_variants_are_kept_side_by_side(checkpoint):
    three = import_weights("small", checkpoint("three", "a.pth")[0])
    five = import_weights("small", checkpoint("five", "b.pth")[0], {"variant": "five"})
    assert {entry.path for entry in list_weights("small")} == {three.path, five.path}
    assert nat2024.create_enhancer("small", variant="three").weights.path == three.path
    assert nat2024.create_enhancer("small", variant="five").weights.path == five.path
    with pytest.raises(WeightsMissing, match=r"several .* variant=five or variant=three"):
        nat2024.create_enhancer("small")
    assert [verdict.ok for verdict in verify_weights()] == [True, True]


def test_a_plugins_own_default_decides_between_variants(checkpoint, monkeypatch):
    import_weights("small", checkpoint("three", "a.pth")[0])
    import_weights("small", checkpoint("five", "b.pth")[0], {"variant": "five"})
    monkeypatch.setitem(Small.__init__.__kwdefaults__, "variant", "five")
    assert nat2024.create_enhancer("small").variant == "five"


def test_the_same_options_again_replace_the_file(checkpoint, folder):
    first = import_weights("small", checkpoint()[0])
    path, state = checkpoint(seed=2)
    second = import_weights("small", path)
    assert list_weights() == [second]
    assert not first.path.exists()
    assert len(list((folder / "small").iterdir())) == 2
    assert torch.equal(nat2024.create_enhancer("small").model.conv.bias, state["conv.bias"])
    import_weights("small", path)
    assert len(list((folder / "small").iterdir())) == 2


def test_weights_that_a_killed_import_left_are_removed_by_the_next(checkpoint, folder):
    path = import_weights("small", checkpoint()[0]).path.parent
    orphan, running, own = (
        path / name
        for name in ("variant-five-aa-0123456789ab.pt", "default-0123456789ab.pt", "my-notes.txt")
    )
    half = path / ".variant-v2-ae36d959-17ba793bfa40-01234567.tmp"
    half.mkdir()
    for left in (orphan, running, own):
        left.write_text("left")
    for old in (orphan, own, half):
        os.utime(old, (1e9, 1e9))
    kept = import_weights("small", checkpoint(seed=2)[0])
    assert sorted(path.iterdir()) == sorted([running, own, kept.path, kept.record])


def test_nothing_is_removed_beside_a_record_that_cannot_be_read(checkpoint, folder):
    path = import_weights("small", checkpoint()[0]).path
    os.utime(path, (1e9, 1e9))
    (record,) = path.parent.glob("*.json")
    record.write_text("{")
    import_weights("small", checkpoint("five")[0], {"variant": "five"})
    assert path.exists()


def test_safetensors_are_kept_byte_for_byte(tmp_path, checkpoint):
    _, state = checkpoint()
    path = tmp_path / "small.safetensors"
    save_file({k: v.clone() for k, v in state.items()}, path, metadata={"made": "here"})
    entry = import_weights("small", path)
    assert (entry.form, entry.entries) == ("copy", 4)
    assert entry.path.read_bytes() == path.read_bytes()
    assert nat2024.create_enhancer("small").weights.origin == "registered"


def test_damage_is_seen(checkpoint):
    entry = import_weights("small", checkpoint()[0])
    content = bytearray(entry.path.read_bytes())
    content[-1] ^= 1  # a weight, so that the file still reads
    entry.path.write_bytes(content)
    with pytest.raises(WeightsMismatch, match=r"are damaged; import them anew \(nat-bench weig"):
        nat2024.create_enhancer("small")
    (verdict,) = verify_weights("small")
    assert not verdict.ok
    assert "are damaged" in verdict.problem
    entry.path.unlink()
    assert "are gone" in verify_weights()[0].problem
    assert nat2024.create_enhancer("small", weights=False)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"file": "../../../etc/passwd"}, "names another plugin or a file elsewhere"),
        ({"file": ".."}, "names another plugin or a file elsewhere"),
        ({"file": "/etc/passwd"}, "names another plugin or a file elsewhere"),
        ({"plugin": "other"}, "names another plugin or a file elsewhere"),
        ({"format": 2}, "Invalid enum value 2"),
        ({"more": 1}, "unknown field `more`"),
    ],
)
def test_records_that_lie_are_refused(checkpoint, change, message):
    entry = import_weights("small", checkpoint()[0])
    entry.record.write_text(json.dumps({**json.loads(entry.record.read_text()), **change}))
    with pytest.raises(WeightsMismatch, match=message):
        nat2024.create_enhancer("small")
    (verdict,) = verify_weights()
    assert message in verdict.problem
    assert describe_weights_at_hand("small", Small.card) == "registered, but not readable"


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", b"[]"])
def test_unreadable_records_are_named(checkpoint, content):
    entry = import_weights("small", checkpoint()[0])
    entry.record.write_bytes(content)
    with pytest.raises(WeightsMismatch, match=rf"{entry.record.name}: not a record of registered"):
        list_weights()
    import_weights("small", checkpoint()[0])
    assert len(list_weights()) == 1


class Hostile:
    """Writes a file when it is unpickled with full trust."""

    def __init__(self, target):
        self.target = target

    def __reduce__(self):
        return (exec, (f"open({str(self.target)!r}, 'w').write('run')",))


def test_code_in_a_checkpoint_does_not_run_and_nothing_is_registered(tmp_path, checkpoint, folder):
    _, state = checkpoint()
    target, path = tmp_path / "ran", tmp_path / "hostile.pth"
    torch.save({"state_dict": dict(state), "optimizer": Hostile(target)}, path)
    with pytest.raises(WeightsMismatch, match=r"hostile\.pth: refused"):
        import_weights("small", path)
    assert not target.exists()
    assert not folder.exists()
    torch.load(path, weights_only=False)
    assert target.exists()  # so the test would have noticed


def test_bad_files_are_refused_in_one_line(tmp_path, checkpoint, folder):
    path, state = checkpoint()
    empty = tmp_path / "empty.pth"
    empty.write_bytes(b"")
    infinite = tmp_path / "infinite.pth"
    bias = torch.full((3,), float("nan"))
    torch.save({**state, "conv.bias": bias, "again.bias": bias}, infinite)
    for given, error, message in (
        (tmp_path / "absent.pth", WeightsMissing, "absent.pth: no such file"),
        (empty, WeightsMismatch, "empty.pth: is an empty file"),
        (tmp_path, WeightsMismatch, "is a folder; name the checkpoint file in it"),
        (infinite, WeightsMismatch, "conv.bias holds numbers that are not finite"),
    ):
        with pytest.raises(error, match=message) as caught:
            import_weights("small", given)
        assert "\n" not in str(caught.value)
    assert not folder.exists()
    with pytest.raises(InvalidOption, match="gamma takes no weights"):
        import_weights("gamma", path)
    with pytest.raises(InvalidOption, match="no option 'varient'; closest: variant"):
        import_weights("small", path, {"varient": "five"})


def test_a_checkpoint_of_another_variant_names_it(checkpoint):
    path, _ = checkpoint("five")
    with pytest.raises(WeightsMismatch, match="it looks like one of variant five: pass variant=f"):
        import_weights("small", path)
    with pytest.raises(WeightsMismatch, match=r"it looks like a checkpoint of small \(variant fi"):
        nat2024.create_enhancer("ldenhancer", weights=path)


def test_a_file_in_place_of_the_folder_is_named(checkpoint, folder):
    path, _ = checkpoint()
    folder.write_text("")
    with pytest.raises(Unwritable, match="cannot be written"):
        import_weights("small", path)
    assert list_weights() == []


def test_entries_are_removed_one_by_one_or_all(checkpoint, folder):
    import_weights("small", checkpoint("three", "a.pth")[0])
    five = import_weights("small", checkpoint("five", "b.pth")[0], {"variant": "five"})
    with pytest.raises(UsageError, match=r"several .*\(variant=five; variant=three\); name one"):
        remove_weights("small")
    assert remove_weights("small", {"variant": "five"}) == [five]
    assert not five.path.exists()
    assert len(remove_weights("small", every=True)) == 1
    assert list((folder / "small").iterdir()) == []
    with pytest.raises(WeightsMissing, match="no weights are registered for small; nothing is r"):
        remove_weights("small")


def test_weights_of_a_plugin_that_is_gone_can_be_removed(checkpoint):
    import_weights("small", checkpoint()[0])
    del registry._registered["small"]
    (verdict,) = verify_weights()
    assert "unknown plugin 'small'" in verdict.problem
    remove_weights("small")
    assert verify_weights() == []


def test_names_never_leave_the_folder(checkpoint, folder, tmp_path):
    import_weights("small", checkpoint()[0])
    (tmp_path / "other").mkdir()
    shutil.copytree(folder / "small", tmp_path / "small")
    for name in ("../small", "..", "small/../small", "/etc", "", "Small", "a b"):
        for call in (remove_weights, list_weights, verify_weights):
            with pytest.raises(WeightsMissing, match="is no plugin name"):
                call(name)
    assert len(list((tmp_path / "small").iterdir())) == 2


def test_options_with_odd_texts_give_plain_file_names(checkpoint, folder, monkeypatch):
    monkeypatch.setattr(Small, "build", lambda _: nn.ModuleDict({"conv": nn.Conv2d(3, 3, 1)}))
    path, _ = checkpoint()
    names = ["../../x", "a/b", "..", ".", "C:\\x", "ä" * 300, "a", "a "]
    entries = [import_weights("small", path, {"variant": name}) for name in names]
    assert len({entry.record for entry in entries}) == len(names)
    for entry in entries:
        assert entry.path.resolve().parent == folder / "small"
        assert entry.record.is_file()
    assert len(list_weights()) == len(names)


@pytest.mark.shared
def test_a_folder_of_onnx_files_is_copied_as_it_is(shared):
    source = shared / "parity" / "trackers" / "nanotrack"
    entry = import_weights("opencv_nano", source, {"variant": "v2"})
    assert entry.form == "copy"
    names = sorted(path.name for path in entry.path.iterdir())
    assert names == ["nanotrackv2_backbone.onnx", "nanotrackv2_head.onnx"]
    for name in names:
        assert (entry.path / name).read_bytes() == (source / name).read_bytes()
    tracker = nat2024.create_tracker("opencv_nano")
    assert (tracker.variant, tracker.weights.origin) == ("v2", "registered")
    assert "backbone" in tracker.weights.known_as
    assert verify_weights("opencv_nano")[0].ok


@pytest.mark.shared
def test_the_official_file_is_known_and_gives_the_same_images(shared):
    from nat2024.testing.enhancers import night_image

    path = shared / "parity" / "enhancers" / "checkpoints" / "ldenhancer_model.pth"
    entry = import_weights("ldenhancer", path)
    assert (entry.known_as, entry.options) == ("model.pth", {})
    image = night_image(40, 56)
    given = nat2024.create_enhancer("ldenhancer", weights=path)
    found = nat2024.create_enhancer("ldenhancer")
    assert (found.enhance(image) == given.enhance(image)).all()
    assert found.weights.known_as == given.weights.known_as == "model.pth"
    assert found.weights.sha256 == given.weights.sha256
    path = path.with_name("dcepp_epoch99.pth")
    with pytest.raises(WeightsMismatch, match=r"it is Epoch99.pth of dcepp$"):
        import_weights("ldenhancer", path)
