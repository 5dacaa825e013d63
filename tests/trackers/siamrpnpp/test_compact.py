"""The variant `compact`: its network, its bundled weights, and what they were trained on."""

import hashlib
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import torch

import nat2024
from nat2024.cli import run
from nat2024.errors import WeightsMismatch
from nat2024.metrics.geometry import overlap
from nat2024.night import NightSequence, NightSettings
from nat2024.night.sample import SEEDS
from nat2024.store import PluginRecord, RunFolder, WeightsRecord
from nat2024.weights import import_weights
from nat2024.zoo import bundled_path
from nat2024_trackers.siamrpnpp.compact import CompactSiamRPN, template_statistics
from nat2024_trackers.siamrpnpp.plugin import SiamRPNpp

GOLDEN = Path(__file__).resolve().parents[2] / "data" / "compact_golden.json"
FACTS = json.loads(files("nat2024_trackers.siamrpnpp").joinpath("weights/compact.json").read_text())


@pytest.fixture(scope="module")
def state(procedural_state, recipe_of):
    with torch.device("meta"):
        network = CompactSiamRPN()
    special = {f"rpn_head.{name}.head.3.weight": {"scale": 0.2} for name in ("cls", "loc")}
    return procedural_state(recipe_of(network, "compact", special))


@pytest.fixture
def network(state):
    network = CompactSiamRPN()
    network.load_state_dict(state)
    return network.eval()


def test_the_network_has_its_size():
    with torch.device("meta"):
        network = CompactSiamRPN().eval()
        small, large = torch.empty(2, 3, 127, 127), torch.empty(2, 3, 255, 255)
        classes, offsets = network(small, large)
        features = [network.backbone(crop).shape for crop in (small, large)]
    assert sum(parameter.numel() for parameter in network.parameters()) == 1_312_318
    assert features == [(2, 128, 6, 6), (2, 128, 22, 22)]
    assert classes.shape == (2, 10, 17, 17)
    assert offsets.shape == (2, 20, 17, 17)


def test_a_clip_gives_the_stored_numbers(clip, state):
    """Golden numbers of this implementation with weights that follow from a formula."""
    tracker = SiamRPNpp(weights=False, variant="compact")
    tracker.model.load_state_dict(state)
    frames, box = clip
    tracker.init(frames[0], box)
    found = []
    for frame in frames[1:4]:
        row, score = tracker.update(frame)
        found.append([tracker.last_step.index, score, *row])
    expected = json.loads(GOLDEN.read_text())
    assert [row[0] for row in found] == [row[0] for row in expected]
    np.testing.assert_allclose(found, expected, atol=1e-3, rtol=1e-4)


def test_the_folded_form_equals_the_one_that_is_trained(network):
    generator = torch.Generator().manual_seed(2)
    crops = [torch.rand(2, 3, side, side, generator=generator) * 255 for side in (127, 191)]
    plain = network(*crops)
    with torch.no_grad():
        folded = network(*crops)
    for one, other in zip(plain, folded, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-3, atol=1e-4)


def test_the_template_normalises_the_search_crop(network):
    """Light that changes both crops alike changes nothing."""
    generator = torch.Generator().manual_seed(3)
    template, search = (
        60 + torch.rand(1, 3, side, side, generator=generator) * 120 for side in (127, 191)
    )
    with torch.no_grad():
        kernels = network.embed(template)
        before, _ = network.match(kernels, search)
        brighter, _ = network(template + 40, search + 40)
        unlike, _ = network(template, search + 40)
    assert len(kernels) == 4
    torch.testing.assert_close(before, brighter, rtol=1e-3, atol=1e-3)
    assert (before - unlike).abs().max() > 0.05
    mean, spread = template_statistics(template)
    assert mean.item() == pytest.approx(template.mean().item())
    assert spread.item() == pytest.approx(template.numpy().std() + 3, rel=1e-5)


def test_sequences_in_one_batch_keep_their_own_template(network):
    generator = torch.Generator().manual_seed(4)
    templates = (
        torch.rand(2, 3, 127, 127, generator=generator)
        * torch.tensor([40.0, 250])[:, None, None, None]
    )
    search = torch.rand(2, 3, 191, 191, generator=generator) * 200
    with torch.no_grad():
        together, _ = network(templates, search)
        for number in (0, 1):
            alone, _ = network(templates[number : number + 1], search[number : number + 1])
            torch.testing.assert_close(together[number : number + 1], alone, rtol=1e-3, atol=1e-3)


def test_it_is_the_default_until_weights_are_given(tmp_path, alex_state):
    tracker = nat2024.create_tracker("siamrpnpp")
    assert tracker.variant == "compact"
    assert tracker.weights.origin == "bundled"
    assert tracker.weights.known_as == "compact.safetensors"
    assert nat2024.create_tracker("siamrpnpp", weights=False).variant == "alex"
    torch.save(alex_state, tmp_path / "model.pth")
    assert nat2024.create_tracker("siamrpnpp", weights=tmp_path / "model.pth").variant == "alex"


def test_registered_weights_come_before_it(tmp_path, alex_state, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path / "weights"))
    torch.save(alex_state, tmp_path / "model.pth")
    import_weights("siamrpnpp", tmp_path / "model.pth")
    tracker = nat2024.create_tracker("siamrpnpp")
    assert (tracker.variant, tracker.weights.origin) == ("alex", "registered")
    asked = nat2024.create_tracker("siamrpnpp", variant="compact")
    assert (asked.variant, asked.weights.origin) == ("compact", "bundled")


def test_its_weights_do_not_pass_for_the_official_ones():
    [file] = [file for file in SiamRPNpp.card.weights if file.bundled]
    with pytest.raises(WeightsMismatch, match="variant compact: pass variant=compact"):
        nat2024.create_tracker("siamrpnpp", weights=bundled_path(file))


def test_the_bundled_file_is_small_and_what_the_card_says():
    [file] = [file for file in SiamRPNpp.card.weights if file.bundled]
    data = bundled_path(file).read_bytes()
    assert len(data) == file.bytes <= 4 * 2**20
    assert hashlib.sha256(data).hexdigest() == file.sha256
    card = files("nat2024_trackers.siamrpnpp").joinpath("weights/README.md").read_text("utf-8")
    assert "Images from BoofCV-Data by Peter Abeles, CC BY 4.0" in card


@pytest.mark.parametrize(("kind", "seed"), [("car", 430_001), ("boat", 430_002)])
def test_the_bundled_weights_follow_a_rendered_target(kind, seed):
    sequence = NightSequence(NightSettings(kind, 12, (320, 180), seed=seed))
    tracker = nat2024.create_tracker("siamrpnpp")
    first = sequence.frame(0)
    tracker.init(first.image, first.box)
    overlaps, moved = [], []
    for index in range(1, 12):
        frame = sequence.frame(index)
        row, score = tracker.update(frame.image)
        assert 0 <= score <= 1
        overlaps.append(overlap(row[None], frame.box[None])[0])
        moved.append(overlap(first.box[None], frame.box[None])[0])
    assert np.mean(overlaps) > 0.5
    assert min(overlaps) > 0.2


def test_nothing_of_the_sample_was_trained_on_or_chosen_by():
    for name in ("training_seeds", "choice_seeds"):
        first, last = FACTS[name]
        assert not set(range(first, last + 1)) & set(SEEDS)
    sample = nat2024.load_dataset("night_mini")
    trained = set(FACTS["photographs_sha256"])
    assert len(trained) == FACTS["photographs"]
    archive = files("nat2024.datasets").joinpath("samples/night_mini.zip")
    assert sample.name == "night_mini"
    import zipfile

    with zipfile.ZipFile(str(archive)) as opened:
        hashes = {hashlib.sha256(opened.read(name)).hexdigest() for name in opened.namelist()}
    assert len(hashes) > 300
    assert not trained & hashes


@pytest.mark.shared
def test_nothing_of_the_real_sequences_was_trained_on(shared):
    """All photographs are from the folder with a licence, none from the sequences."""
    trained = set(FACTS["photographs_sha256"])
    allowed = {
        hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (shared / "realdata" / "natural_images_ccby").glob("*.jpg")
    }
    assert trained == allowed
    others = (shared / "realdata" / "data_seq").rglob("*.jpg")
    assert not trained & {hashlib.sha256(path.read_bytes()).hexdigest() for path in others}


def test_a_run_says_it_keeps_it_and_shows_it(night_clip, tmp_path, capsys):
    words = ["run", "--tracker", "siamrpnpp", "--dataset", str(night_clip), "--sequences", "wide"]
    assert run([*words, "--results", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert "siamrpnpp (compact): weights compact.safetensors, which come with the package" in err
    assert err.count("which come with the package") == 1
    assert "siamrpnpp (compact)" in out
    stored = RunFolder(tmp_path / "night_clip" / "siamrpnpp").manifest()
    assert stored.tracker.options["variant"] == "compact"
    assert (stored.tracker.weights.origin, stored.tracker.weights.known_as) == (
        "bundled",
        "compact.safetensors",
    )


def test_only_bundled_weights_are_marked():
    bundled = WeightsRecord("bundled", "a", "b", "compact.safetensors")
    record = PluginRecord("siamrpnpp", "x", {"variant": "compact"}, bundled)
    assert (record.title, record.shown) == ("siamrpnpp@x", "siamrpnpp@x (compact)")
    given = PluginRecord("siamrpnpp", "", {"variant": "compact"}, WeightsRecord("given", "a"))
    assert given.shown == "siamrpnpp"
    assert PluginRecord("ldenhancer", "", {}, bundled).shown == "ldenhancer"
