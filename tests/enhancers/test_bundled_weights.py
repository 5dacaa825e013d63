"""The weights that come with `ldenhancer` and `dcepp`: found, safe, and as their cards say."""

import hashlib
import json
import re
import zipfile
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import torch

import nat2024
from nat2024.datasets.roots import bundled_archive
from nat2024.errors import InvalidOption, WeightsMismatch
from nat2024.measures.adaptivity import measure_adaptivity
from nat2024.night import NightSequence, NightSettings
from nat2024.night.sample import SEEDS
from nat2024.night.training_images import TrainingImages
from nat2024.weights import import_weights
from nat2024.zoo import bundled_path, find_weights, preset_weights, sha256_of

PLUGINS = ("ldenhancer", "dcepp")
FILES = [
    pytest.param(name, file, id=f"{name}-{file.preset}")
    for name in PLUGINS
    for file in nat2024.create_enhancer(name, weights=False).card.weights
    if file.bundled
]
PRESETS = ("default", "adaptive", "bright")


def folder_of(name):
    return Path(str(files(f"nat2024_enhancers.{name}").joinpath("weights")))


@pytest.fixture(autouse=True)
def nothing_is_registered(tmp_path, monkeypatch):
    monkeypatch.setenv("NAT2024_WEIGHTS", str(tmp_path / "registered"))


@pytest.fixture(scope="module")
def night():
    """Rendered night frames, float32 (4, 3, 192, 256) RGB, of seeds that nothing trains on."""
    frames = []
    for seed, kind in enumerate(("car", "person", "boat", "bus"), 880_000):
        settings = NightSettings(kind, frames=2, size=(256, 192), seed=seed)
        frames.append(NightSequence(settings).frame(0).image[..., ::-1].transpose(2, 0, 1).copy())
    return torch.from_numpy(np.stack(frames)).float() / 255


def lift(enhancer, batch):
    """Mean grey level of dark and of bright pixels, before and after."""
    after, before = enhancer.enhance_batch(batch).mean(dim=1), batch.mean(dim=1)
    dark, bright = before < 0.15, before > 0.7
    return [float(levels[part].mean()) for part in (dark, bright) for levels in (before, after)]


def adaptivity(enhancer, batch):
    pairs = zip(batch, enhancer.enhance_batch(batch), strict=True)
    return measure_adaptivity([tuple(x.permute(1, 2, 0).numpy() for x in pair) for pair in pairs])


@pytest.mark.parametrize(("name", "file"), FILES)
def test_each_file_is_small_whole_and_has_its_card(name, file):
    path = bundled_path(file)
    assert path.stat().st_size == file.bytes < 1_000_000
    assert sha256_of(path) == file.sha256
    assert path.parent == folder_of(name)
    card = path.with_suffix(".md").read_text(encoding="utf-8")
    assert "not the authors' weights" in card
    assert file.sha256 in card
    assert "Images from BoofCV-Data by Peter Abeles, CC BY 4.0" in card
    for part in ("Data", "Recipe", "Seed", "revision", "dark_after"):
        assert part in card, part
    assert "BoofCV-Data by Peter Abeles" in file.licence


@pytest.mark.parametrize("name", PLUGINS)
def test_the_attribution_stands_beside_the_weights(name):
    text = (folder_of(name) / "ATTRIBUTION.txt").read_text(encoding="utf-8")
    assert text.strip() == "Images from BoofCV-Data by Peter Abeles, CC BY 4.0"


@pytest.mark.parametrize("name", PLUGINS)
def test_nothing_of_the_sample_was_trained_on(name):
    facts = json.loads((folder_of(name) / "images.json").read_text(encoding="utf-8"))
    seeds = TrainingImages(**facts["settings"]).seeds(len(facts["photographs"]))
    assert not [seed for some in seeds for seed in some if seed in SEEDS]
    with zipfile.ZipFile(bundled_archive("night_mini")) as archive:
        frames = {hashlib.sha256(archive.read(one)).hexdigest() for one in archive.namelist()}
    assert len(frames) > 394
    assert not frames & set(facts["photographs"].values())
    assert len(facts["photographs"]) > 200


@pytest.mark.parametrize("name", PLUGINS)
def test_bundled_weights_are_the_default_and_say_so(name):
    enhancer = nat2024.create_enhancer(name)
    assert enhancer.weights.origin == "bundled"
    assert enhancer.weights.known_as == f"{name}-default.safetensors"
    assert all(torch.isfinite(value).all() for value in enhancer.model.state_dict().values())


def test_presets_choose_among_them(tmp_path):
    digests = set()
    for preset in PRESETS:
        enhancer = nat2024.create_enhancer("ldenhancer", preset=preset)
        assert enhancer.weights.known_as == f"ldenhancer-{preset}.safetensors"
        digests.add(enhancer.weights.sha256)
        again = nat2024.create_enhancer("ldenhancer", preset=preset, weights=enhancer.weights)
        assert again.weights == enhancer.weights  # as a worker process gets them
    assert len(digests) == 3
    plain = nat2024.create_enhancer("ldenhancer")
    assert (
        plain.weights.sha256
        == nat2024.create_enhancer("ldenhancer", preset="default").weights.sha256
    )


def test_a_named_preset_comes_before_registered_weights(tmp_path):
    torch.manual_seed(1)
    model = nat2024.create_enhancer("ldenhancer", weights=False).model
    torch.save(model.state_dict(), tmp_path / "own.pth")
    import_weights("ldenhancer", tmp_path / "own.pth")
    assert nat2024.create_enhancer("ldenhancer").weights.origin == "registered"
    assert nat2024.create_enhancer("ldenhancer", preset="default").weights.origin == "bundled"


@pytest.mark.parametrize("weights", [False, "own.pth"])
def test_a_preset_beside_other_weights_is_refused(weights):
    with pytest.raises(InvalidOption, match="leave the option or --weights out"):
        nat2024.create_enhancer("ldenhancer", preset="bright", weights=weights)


def test_unknown_presets_are_refused():
    with pytest.raises(InvalidOption, match=r"ldenhancer.preset=dark"):
        nat2024.create_enhancer("ldenhancer", preset="dark")
    card = nat2024.create_enhancer("dcepp", weights=False).card
    with pytest.raises(InvalidOption, match="no weights come with dcepp for preset=dark"):
        preset_weights("dcepp", "dark", None, card)


def test_another_network_does_not_get_them():
    with pytest.raises(WeightsMismatch, match="not a checkpoint of this network"):
        nat2024.create_enhancer("ldenhancer", iterations=2)


def test_the_default_lifts_the_dark_and_spares_the_bright(night):
    enhancer = nat2024.create_enhancer("ldenhancer")
    dark, lifted, bright, risen = lift(enhancer, night)
    assert 1.5 < lifted / dark < 2.0
    assert 0.03 < risen - bright < 0.10
    found = adaptivity(enhancer, night)
    assert found.verdict == "a fixed tone curve"


def test_the_adaptive_preset_adapts(night):
    enhancer = nat2024.create_enhancer("ldenhancer", preset="adaptive")
    dark, lifted, bright, risen = lift(enhancer, night)
    assert 1.8 < lifted / dark < 3.8
    assert risen - bright < 0.12
    found = adaptivity(enhancer, night)
    assert found.verdict == "adapts inside images"
    assert found.gain_per_stop < -0.05  # places in the dark gain more
    amount = enhancer.maps(night)["A"].mean(dim=1)
    assert amount.std(dim=(1, 2)).mean() > 0.05


def test_bright_and_dcepp_lift_more(night):
    usual = lift(nat2024.create_enhancer("ldenhancer"), night)[1]
    for name, options in (("ldenhancer", {"preset": "bright"}), ("dcepp", {})):
        enhancer = nat2024.create_enhancer(name, **options)
        assert lift(enhancer, night)[1] > 1.3 * usual, name


def test_red_and_blue_are_treated_alike(night):
    """So that images may be fed in either order, as trackers feed BGR."""
    enhancer = nat2024.create_enhancer("ldenhancer")
    difference = enhancer.enhance_batch(night.flip(1)).flip(1) - enhancer.enhance_batch(night)
    assert difference.abs().mean() < 0.01


@pytest.mark.parametrize(("name", "file"), FILES)
def test_black_white_and_noise_stay_images(name, file):
    options = {"preset": file.preset} if name == "ldenhancer" else {}
    enhancer = nat2024.create_enhancer(name, **options)
    batch = torch.rand(3, 3, 48, 48, generator=torch.Generator().manual_seed(0))
    batch[0], batch[1] = 0, 1
    after = enhancer.enhance_batch(batch)
    assert after.isfinite().all()
    assert after[0].max() == 0
    assert after[1].min() > 0.99


def test_training_again_is_one_command():
    """The card's recipe names a preset that the trainer knows, and all of its values."""
    from nat2024.enhancing.training import choose_settings

    for name in PLUGINS:
        for card in folder_of(name).glob("*.md"):
            text = card.read_text(encoding="utf-8")
            found = re.search(r"nat-bench train (\w+) --preset (\w+) ((?:--set \S+ ?)*)`", text)
            values = dict(one.split("=") for one in re.findall(r"--set (\S+)", found[3]))
            loop, pictures, own = choose_settings(found[1], found[2], values)
            config = json.loads(re.search(r"```json\n(.*?)```", text, re.DOTALL)[1])
            assert found[1] == name
            assert config["loss"]["level"] == own.level
            assert config["settings"]["learning_rate"] == loop.learning_rate
            assert config["pictures"]["crop"] == pictures.crop


def test_batch_norms_have_seen_images():
    for preset in PRESETS:
        state = nat2024.create_enhancer("ldenhancer", preset=preset).model.state_dict()
        counts = {int(state[key]) for key in state if key.endswith("num_batches_tracked")}
        assert min(counts) >= 15, preset


def test_find_weights_knows_them_without_a_plugin():
    card = nat2024.create_enhancer("ldenhancer", weights=False).card
    assert find_weights("ldenhancer", None, card).known_as == "ldenhancer-default.safetensors"
