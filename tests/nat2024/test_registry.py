"""Finding plugins, checking their options, and saying what is wrong with a broken one."""

from pathlib import Path
from typing import Any, Literal

import pytest

import nat2024
from nat2024 import registry
from nat2024.cards import Card
from nat2024.errors import (
    BrokenPlugin,
    DuplicatePlugin,
    InvalidOption,
    UnknownPlugin,
    UsageError,
    WeightsMissing,
)


def test_entry_points_are_listed() -> None:
    assert {"none", "gamma", "clahe", "ldenhancer"} <= set(nat2024.list_enhancers())
    assert {"siamrpnpp", "opencv_nano", "mil"} <= set(nat2024.list_trackers())
    assert nat2024.list_trackers("siam*") == ["siamapn", "siamapnpp", "siamrpnpp"]
    assert nat2024.list_enhancers("nothing*") == []


def test_unknown_name_gives_the_closest() -> None:
    with pytest.raises(UnknownPlugin, match=r"unknown enhancer 'ldenhacer'; closest: ldenhancer"):
        nat2024.create_enhancer("ldenhacer")


def test_name_of_the_other_kind_is_told() -> None:
    with pytest.raises(UnknownPlugin, match=r"mil is a tracker"):
        nat2024.create_enhancer("mil")


@pytest.mark.usefixtures("small_plugins")
def test_decorated_classes_are_found() -> None:
    assert "still" in nat2024.list_trackers()
    tracker = nat2024.create_tracker("still", step=2, enhancer="invert")
    assert tracker.name == "still"
    assert tracker.step == 2.0


@pytest.mark.usefixtures("small_plugins")
def test_a_name_taken_twice_is_refused_for_both_kinds() -> None:
    with pytest.raises(DuplicatePlugin, match="'still' is taken twice"):
        registry.register_enhancer("still")(type("Other", (), {}))
    with pytest.raises(DuplicatePlugin, match="'gamma' is taken twice"):
        registry.register_tracker("gamma")(type("Other", (), {}))


@pytest.mark.usefixtures("small_plugins")
def test_override_replaces() -> None:
    from nat2024 import Enhancer

    class Mine(Enhancer):
        card = Card(title="Mine", summary="")

        def enhance_batch(self, batch: Any) -> Any:
            return batch

    registry.register_enhancer("gamma", override=True)(Mine)
    assert isinstance(nat2024.create_enhancer("gamma"), Mine)


def test_names_are_small_letters() -> None:
    with pytest.raises(InvalidOption, match="no plugin name"):
        registry.register_tracker("SiamRPN++")


class _Base:
    def __init__(self, *, scope: Literal["patch", "frame"] = "patch", device: str = "cpu") -> None:
        pass


class _Plugin(_Base):
    name = "plugin"

    def __init__(
        self, *, strength: float = 0.5, steps: int | None = None, deep: bool = False, **common: Any
    ) -> None:
        super().__init__(**common)
        self.given = strength, steps, deep


def test_options_come_from_the_signatures_of_the_class_and_its_bases() -> None:
    options = registry.plugin_options(_Plugin)
    assert list(options) == ["strength", "steps", "deep", "scope"]
    assert options["scope"].default == "patch"


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ({"strength": "0.25"}, {"strength": 0.25}),
        ({"strength": 2}, {"strength": 2.0}),
        ({"steps": "3"}, {"steps": 3}),
        ({"steps": None}, {"steps": None}),
        ({"deep": "true"}, {"deep": True}),
        ({"deep": "0"}, {"deep": False}),
        ({"scope": "frame"}, {"scope": "frame"}),
    ],
)
def test_texts_become_the_options_own_type(given: dict[str, Any], wanted: dict[str, Any]) -> None:
    resolved = registry.resolve_options(_Plugin, given)
    defaults = {"strength": 0.5, "steps": None, "deep": False, "scope": "patch"}
    assert resolved == {**defaults, **wanted}
    assert all(type(resolved[key]) is type(value) for key, value in wanted.items())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"strenght": 1}, r"plugin has no option 'strenght'; closest: strength"),
        ({"strength": "much"}, r"option plugin.strength=much: expected `float`"),
        ({"scope": "crop"}, r"option plugin.scope=crop: invalid enum value"),
        ({"steps": 1.5}, r"option plugin.steps=1.5: expected `int \| null`"),
    ],
)
def test_wrong_options_are_named(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidOption, match=message):
        registry.resolve_options(_Plugin, given)


def test_weights_for_a_method_without_weights_are_refused() -> None:
    with pytest.raises(InvalidOption, match="gamma takes no weights"):
        nat2024.create_enhancer("gamma", weights="some.pth")


def test_an_object_without_enhance_batch_is_no_enhancer() -> None:
    with pytest.raises(InvalidOption, match="must be a name or have enhance_batch"):
        nat2024.create_tracker("mil", enhancer=object())  # type: ignore[arg-type]


def test_a_plugin_file_that_fails_says_why(tmp_path: Any) -> None:
    (tmp_path / "bad.py").write_text("import nothing_of_this_name\n")
    with pytest.raises(BrokenPlugin, match=r"bad\.py cannot be loaded: ModuleNotFoundError"):
        registry.load_plugin_file(str(tmp_path / "bad.py"))
    with pytest.raises(BrokenPlugin, match=r"absent\.py cannot be loaded: FileNotFoundError"):
        registry.load_plugin_file(str(tmp_path / "absent.py"))


@pytest.mark.usefixtures("small_plugins")
def test_a_broken_plugin_stays_listed_and_breaks_no_other(monkeypatch: Any) -> None:
    def explode() -> type:
        message = "no such library"
        raise ImportError(message)

    entry = registry.Entry("broken", "enhancer", "broken:Broken", explode)
    monkeypatch.setitem(registry._registered, "broken", entry)
    assert "broken" in nat2024.list_enhancers()
    with pytest.raises(BrokenPlugin, match=r"broken \(broken:Broken\) cannot be imported"):
        nat2024.create_enhancer("broken")
    assert nat2024.create_enhancer("invert")


def test_a_class_of_the_wrong_kind_is_refused(monkeypatch: Any) -> None:
    entry = registry.Entry("wrong", "enhancer", "wrong:dict", lambda: dict)
    monkeypatch.setitem(registry._registered, "wrong", entry)
    with pytest.raises(BrokenPlugin, match="is no subclass of Enhancer"):
        nat2024.create_enhancer("wrong")


def test_a_plugin_without_a_card_is_broken_and_harms_no_other(monkeypatch: Any) -> None:
    from nat2024 import Enhancer

    cls = type("Bare", (Enhancer,), {"enhance_batch": lambda _self, batch: batch, "name": "bare"})
    entry = registry.Entry("bare", "enhancer", "bare:Bare", lambda: cls)
    monkeypatch.setitem(registry._registered, "bare", entry)
    with pytest.raises(BrokenPlugin, match="has no card"):
        nat2024.create_enhancer("bare")


@pytest.mark.usefixtures("small_plugins")
def test_a_plugin_that_fails_to_be_created_is_named() -> None:
    from nat2024 import Enhancer

    @registry.register_enhancer("fragile")
    class Fragile(Enhancer):
        card = Card(title="Fragile", summary="")

        def __init__(self, *, strength: float = 1.0, **base: Any) -> None:
            super().__init__(**base)
            raise SystemExit(3)

        def enhance_batch(self, batch: Any) -> Any:
            return batch

    with pytest.raises(BrokenPlugin, match="fragile cannot be created: SystemExit: 3"):
        nat2024.create_enhancer("fragile")


def test_two_files_of_one_name_do_not_replace_each_other(tmp_path: Any, small_plugins: str) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        text = Path(small_plugins).read_text().replace('"still"', '"twice"')
        (tmp_path / folder / "plug.py").write_text(text.replace('"fails"', f'"fails_{folder}"'))
    registry._registered.clear()
    registry.load_plugin_file(str(tmp_path / "a" / "plug.py"))
    with pytest.raises(DuplicatePlugin, match="'twice' is taken twice"):
        registry.load_plugin_file(str(tmp_path / "b" / "plug.py"))


@pytest.mark.parametrize("device", ["tpu", "cuda:x", "cuda:²", "", "cuda:-1"])
def test_devices_that_are_none(device: str) -> None:
    with pytest.raises(UsageError, match="is none of cpu, cuda, cuda:N"):
        nat2024.create_enhancer("gamma", device=device)


def test_a_device_that_is_not_there() -> None:
    with pytest.raises(UsageError, match="torch sees"):
        nat2024.create_tracker("mil", device="cuda:99")


@pytest.mark.parametrize("weights", [0, True, "", 1.5])
def test_weights_that_are_no_path(weights: Any) -> None:
    with pytest.raises(WeightsMissing, match="must be a path, False or None"):
        nat2024.create_enhancer("ldenhancer", weights=weights)


def test_a_user_folder_that_does_not_exist() -> None:
    with pytest.raises(WeightsMissing, match="no such file"):
        nat2024.create_enhancer("ldenhancer", weights="~nobody_of_this_name/x.pth")
