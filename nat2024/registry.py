"""Finding plugins by name: entry points of installed packages, and a decorator for code at hand.

Entry points are listed without importing anything; a plugin is imported when it is chosen.
"""

import contextlib
import hashlib
import importlib
import importlib.metadata
import importlib.util
import inspect
import re
import sys
import types
import typing
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

import msgspec

from nat2024.cards import Card
from nat2024.errors import (
    BrokenPlugin,
    DuplicatePlugin,
    InvalidOption,
    NatBenchError,
    UnknownPlugin,
    WrongNetwork,
)
from nat2024.files import expand
from nat2024.interfaces import BatchEnhancer, Enhancer, Tracker
from nat2024.types import closest
from nat2024.zoo import WeightsSpec, find_registered, recognise, sha256_of

Kind: TypeAlias = Literal["tracker", "enhancer"]
_BASES: dict[Kind, type] = {"tracker": Tracker, "enhancer": Enhancer}
_NAME = re.compile(r"[a-z0-9][a-z0-9_]*")
_RESERVED = ("self", "weights", "device", "enhancer")
_Plugin = TypeVar("_Plugin", bound=type)


@dataclass(frozen=True, slots=True)
class Entry:
    """One listed plugin: its name, kind, where it comes from and how to get its class."""

    name: str
    kind: Kind
    origin: str
    load: Callable[[], type]


@dataclass(frozen=True, slots=True)
class Option:
    """One option of a plugin, read from the signature of its class."""

    name: str
    type: Any
    default: Any


_registered: dict[str, Entry] = {}


def register_enhancer(name: str, *, override: bool = False) -> Callable[[_Plugin], _Plugin]:
    """Register an `Enhancer` class under `name` (class decorator).

    Raises:
        DuplicatePlugin: the name is taken, unless `override`.
    """
    return _register(name, "enhancer", override)


def register_tracker(name: str, *, override: bool = False) -> Callable[[_Plugin], _Plugin]:
    """Register a `Tracker` class under `name` (class decorator).

    Raises:
        DuplicatePlugin: the name is taken, unless `override`.
    """
    return _register(name, "tracker", override)


def _register(name: str, kind: Kind, override: bool) -> Callable[[_Plugin], _Plugin]:
    if not _NAME.fullmatch(name):
        msg = f"{name!r} is no plugin name: small letters, digits and underscores only"
        raise InvalidOption(msg)

    def decorate(cls: _Plugin) -> _Plugin:
        origin = f"{cls.__module__}:{cls.__qualname__}"
        known = _entries().get(name)
        if known and known.origin != origin and not override:
            msg = f"the name {name!r} is taken twice, by {known.origin} and {origin}"
            raise DuplicatePlugin(msg)
        cls.name = name  # type: ignore[attr-defined]
        _registered[name] = Entry(name, kind, origin, lambda: cls)
        return cls

    return decorate


def _entries() -> dict[str, Entry]:
    """Every plugin by name: entry points first, code registered in this process over them."""
    found: dict[str, Entry] = {}
    for kind in _BASES:
        for point in importlib.metadata.entry_points(group=f"nat_bench.{kind}s"):
            entry = Entry(point.name, kind, point.value, point.load)
            other = found.get(point.name)
            if other and other.origin != entry.origin:
                msg = f"the name {point.name!r} is taken twice, by {other.origin} and {point.value}"
                raise DuplicatePlugin(msg)
            found[point.name] = entry
    return found | _registered


def list_plugins(kind: Kind, pattern: str = "*") -> list[str]:
    """Sorted names of one kind that match a shell pattern; nothing is imported."""
    entries = _entries().values()
    return sorted(e.name for e in entries if e.kind == kind and fnmatchcase(e.name, pattern))


def list_trackers(pattern: str = "*") -> list[str]:
    """Sorted names of all trackers that match a shell pattern, plugins included."""
    return list_plugins("tracker", pattern)


def list_enhancers(pattern: str = "*") -> list[str]:
    """Sorted names of all enhancers that match a shell pattern, plugins included."""
    return list_plugins("enhancer", pattern)


def load_plugin(name: str, kind: Kind) -> type[Any]:
    """Import the class behind a name.

    Raises:
        UnknownPlugin: nothing of that kind has this name; names the closest.
        BrokenPlugin: it cannot be imported or is no class of that kind.
    """
    entry = _entries().get(name)
    if entry is None or entry.kind != kind:
        article = "an" if entry and entry.kind == "enhancer" else "a"
        other = f" ({name} is {article} {entry.kind})" if entry else ""
        other = other or closest(str(name), list_plugins(kind))
        msg = f"unknown {kind} {name!r}{other}; `nat-bench list` shows all"
        raise UnknownPlugin(msg)
    try:
        cls = entry.load()
    except (Exception, SystemExit) as error:  # a foreign plugin may fail in any way
        msg = f"{kind} {name} ({entry.origin}) cannot be imported: {type(error).__name__}: {error}"
        raise BrokenPlugin(msg) from error
    if not (isinstance(cls, type) and issubclass(cls, _BASES[kind])):
        msg = f"{kind} {name} ({entry.origin}) is no subclass of {_BASES[kind].__name__}"
        raise BrokenPlugin(msg)
    if not getattr(cls, "name", ""):
        msg = f"{kind} {name} ({entry.origin}) lacks its @register_{kind}({name!r}) decorator"
        raise BrokenPlugin(msg)
    if not isinstance(getattr(cls, "card", None), Card):
        msg = f"{kind} {name} ({entry.origin}) has no card; give its class card = Card(...)"
        raise BrokenPlugin(msg)
    return cls


def load_plugin_file(source: str) -> None:
    """Run a Python file, or import a module, whose decorators register plugins.

    Raises:
        BrokenPlugin: it is absent or fails.
    """
    path = Path(source)
    try:
        if path.suffix == ".py":
            whole = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
            module_name = f"nat_bench_plugin_{path.stem}_{whole}"
            spec = importlib.util.spec_from_file_location(module_name, path)
            if spec is None or spec.loader is None:
                msg = f"{source} is no Python file"
                raise BrokenPlugin(msg)
            module = importlib.util.module_from_spec(spec)
            sys.modules[module_name] = module
            spec.loader.exec_module(module)
        else:
            importlib.import_module(source)
    except (BrokenPlugin, DuplicatePlugin):
        raise
    except (Exception, SystemExit) as error:  # a foreign plugin may fail in any way
        msg = f"plugin {source} cannot be loaded: {type(error).__name__}: {error}"
        raise BrokenPlugin(msg) from error


def plugin_options(cls: type) -> dict[str, Option]:
    """The options of a plugin: keyword parameters of its class, base classes included."""
    options: dict[str, Option] = {}
    for base in cls.__mro__:
        init = base.__dict__.get("__init__")
        if init is None:
            continue
        parameters = inspect.signature(init).parameters.values()
        named = {one.name: one for one in parameters if one.kind is one.KEYWORD_ONLY}
        kinds = _types_of(init, named)
        for name, parameter in named.items():
            if name not in _RESERVED and name not in options:
                options[name] = Option(name, kinds.get(name, Any), parameter.default)
        if not any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
            break
    return options


def _types_of(function: Any, names: Collection[str]) -> dict[str, Any]:
    """Types of some parameters; those of others may have names that only type checkers know."""
    wanted = {key: kind for key, kind in function.__annotations__.items() if key in names}
    annotated = types.SimpleNamespace(__annotations__=wanted)
    return typing.get_type_hints(annotated, globalns=getattr(function, "__globals__", None))


def resolve_options(cls: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """The full option set of a plugin: what was given, checked and converted, over the defaults.

    Raises:
        InvalidOption: an unknown option (names the closest) or a value of the wrong type.
    """
    options = plugin_options(cls)
    name = getattr(cls, "name", "") or cls.__name__
    resolved = {key: option.default for key, option in options.items()}
    for key, value in given.items():
        if key not in options:
            has = f"it has {', '.join(sorted(options))}" if options else "it has none"
            msg = f"{name} has no option {key!r}{closest(key, options)}; {has}"
            raise InvalidOption(msg)
        try:
            resolved[key] = msgspec.convert(value, options[key].type, strict=False)
        except msgspec.ValidationError as error:
            msg = f"option {name}.{key}={value}: {str(error)[:1].lower()}{str(error)[1:]}"
            raise InvalidOption(msg) from None
    return resolved


def create_enhancer(
    name: str, *, weights: WeightsSpec = None, device: str = "cpu", **options: Any
) -> Enhancer:
    """Create an enhancer by name.

    Args:
        name: a registered name, such as "ldenhancer" or "none".
        weights: a checkpoint path, False for fresh initial weights, None for what the user
            registered (with the options that it was registered for, unless others are given) or
            the package bundles.
        device: "cpu", "cuda", "cuda:1".
        options: the plugin's own options.

    Raises:
        UnknownPlugin, BrokenPlugin, InvalidOption, WeightsMissing, WeightsMismatch: each with one
            line that says what to do.
    """
    cls = load_plugin(name, "enhancer")
    created: Enhancer = _create(cls, device=device, **_arguments(cls, weights, options))
    return created


def create_tracker(
    name: str,
    *,
    weights: WeightsSpec = None,
    enhancer: str | BatchEnhancer | None = None,
    device: str = "cpu",
    **options: Any,
) -> Tracker:
    """Create a tracker by name.

    Args:
        name: a registered name, such as "siamrpnpp".
        weights: as in `create_enhancer`.
        enhancer: a name, an `Enhancer`, or any object with `enhance_batch`.
        device: "cpu", "cuda", "cuda:1".
        options: the plugin's own options, `scope` and others.

    Raises:
        UnknownPlugin, BrokenPlugin, InvalidOption, WeightsMissing, WeightsMismatch: each with one
            line that says what to do.
    """
    cls = load_plugin(name, "tracker")
    if isinstance(enhancer, str):
        enhancer = create_enhancer(enhancer, device=device)
    elif enhancer is not None and not isinstance(enhancer, BatchEnhancer):
        msg = f"enhancer must be a name or have enhance_batch, not {type(enhancer).__name__}"
        raise InvalidOption(msg)
    arguments = _arguments(cls, weights, options)
    created: Tracker = _create(cls, enhancer=enhancer, device=device, **arguments)
    return created


def _create(cls: type[Any], **arguments: Any) -> Any:
    try:
        return cls(**arguments)
    except WrongNetwork as error:
        raise _with_its_name(error, cls, arguments) from None
    except NatBenchError:
        raise
    except (Exception, SystemExit) as error:  # a foreign plugin may fail in any way
        msg = f"{cls.name} cannot be created: {type(error).__name__}: {error}"
        raise BrokenPlugin(msg) from error


def _with_its_name(
    error: WrongNetwork, cls: type[Any], arguments: Mapping[str, Any]
) -> WrongNetwork:
    """The same error, saying also which plugin's checkpoint it is where a card knows it."""
    weights = getattr(arguments.get("weights"), "path", arguments.get("weights"))
    path = expand(weights) if weights else Path()
    digest = sha256_of(path) if path.is_file() else ""
    variant = str(arguments.get("variant") or "")
    what = recognise(error.entries, digest, _cards(), name=cls.name, variant=variant)
    named = WrongNetwork(f"{error}; {what}" if what else str(error))
    named.entries = error.entries
    return named


def _cards() -> dict[str, Card]:
    """Cards of all plugins that can be imported, by name."""
    cards = {}
    for name, entry in sorted(_entries().items()):
        with contextlib.suppress(BrokenPlugin):
            cards[name] = load_plugin(name, entry.kind).card
    return cards


def plugin_kind(name: str) -> Kind:
    """Whether a name is a tracker or an enhancer.

    Raises:
        UnknownPlugin: it is neither; names the closest.
    """
    entries = _entries()
    if name not in entries:
        msg = f"unknown plugin {name!r}{closest(name, entries)}; `nat-bench list` shows all"
        raise UnknownPlugin(msg)
    return entries[name].kind


def takes_weights(cls: type) -> bool:
    """Whether a plugin class has a `weights` argument."""
    return any(
        "weights" in inspect.signature(base.__dict__["__init__"]).parameters
        for base in cls.__mro__
        if "__init__" in base.__dict__ and base is not object
    )


def _arguments(cls: type[Any], weights: WeightsSpec, given: Mapping[str, Any]) -> dict[str, Any]:
    """Weights and options of a plugin; registered weights bring the options they belong to."""
    options = resolve_options(cls, given)
    if weights is None and takes_weights(cls):
        chosen = {key: options[key] for key in given if options[key] is not None}
        weights = find_registered(cls.name, cls.card, chosen, options)
        if weights is not None:
            options = resolve_options(cls, {**weights.options, **chosen})
    return {**_weights_argument(cls, weights), **options}


def _weights_argument(cls: type, weights: WeightsSpec) -> dict[str, WeightsSpec]:
    if takes_weights(cls):
        return {"weights": weights}
    if weights:
        msg = f"{cls.name} takes no weights"  # type: ignore[attr-defined]
        raise InvalidOption(msg)
    return {}
