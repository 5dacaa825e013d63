"""What is to be run: trackers times enhancers, each with its own options and weights."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from nat2024.backends import OPENVINO_FIRST, BackendWish, Precision, backends_of
from nat2024.engine.sharing import SharedFrames
from nat2024.engine.timing import TimedEnhancer
from nat2024.errors import UsageError
from nat2024.interfaces import Enhancer, Scope, Tracker
from nat2024.registry import (
    Kind,
    create_enhancer,
    create_tracker,
    list_plugins,
    load_plugin,
    plugin_options,
    resolve_options,
)
from nat2024.store import (
    DatasetRecord,
    Manifest,
    OnBadFrame,
    PluginRecord,
    WeightsRecord,
    run_name,
)
from nat2024.types import closest
from nat2024.zoo import Weights

_SPEC = re.compile(r"(?P<name>[a-z0-9][a-z0-9_]*)(?:@(?P<label>[A-Za-z0-9._-]+))?")


@dataclass(frozen=True, slots=True)
class PluginSpec:
    """A plugin as it is asked for: `NAME` or `NAME@LABEL`, with options and weights."""

    name: str
    label: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    weights: str | Literal[False] | None = None

    @classmethod
    def parse(cls, text: str) -> "PluginSpec":
        """Read `NAME` or `NAME@LABEL`.

        Raises:
            UsageError: it is neither.
        """
        match = _SPEC.fullmatch(text)
        if not match:
            msg = f"{text!r} is neither NAME nor NAME@LABEL (letters, digits, . _ - in a label)"
            raise UsageError(msg)
        return cls(match["name"], match["label"] or "")

    @property
    def title(self) -> str:
        """`NAME` or `NAME@LABEL`."""
        return f"{self.name}@{self.label}" if self.label else self.name


@dataclass(frozen=True, slots=True)
class Combination:
    """One run: a tracker with one enhancer, or alone (enhancer None)."""

    tracker: PluginSpec
    enhancer: PluginSpec | None
    device: str = "cpu"

    @property
    def run(self) -> str:
        """Name of its run folder."""
        return run_name(self.tracker.title, self.enhancer.title if self.enhancer else "none")

    def create(self) -> tuple[Tracker, Enhancer | None]:
        """A fresh tracker, and the enhancer that it uses through a `TimedEnhancer`."""
        enhancer = self.create_enhancer()
        return self.create_tracker(self.timed(enhancer)), enhancer

    def create_enhancer(self) -> Enhancer | None:
        """A fresh enhancer, None where there is none."""
        spec = self.enhancer
        if spec is None:
            return None
        return create_enhancer(spec.name, weights=spec.weights, device=self.device, **spec.options)

    def timed(
        self, enhancer: Enhancer | None, shared: SharedFrames | None = None
    ) -> TimedEnhancer | None:
        """The enhancer as the tracker sees it, with the frames that it shares with others."""
        return None if enhancer is None else TimedEnhancer(enhancer, self.device, shared)

    def create_tracker(self, timed: TimedEnhancer | None) -> Tracker:
        """A fresh tracker over an enhancer."""
        spec = self.tracker
        return create_tracker(
            spec.name, weights=spec.weights, enhancer=timed, device=self.device, **spec.options
        )


def combine(
    trackers: Iterable[str],
    enhancers: Iterable[str],
    *,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    weights: Mapping[str, str] | None = None,
    scope: Scope | None = None,
    device: str = "cpu",
    backend: BackendWish = "torch",
    precision: Precision = "float32",
) -> list[Combination]:
    """Every tracker with every enhancer.

    Args:
        trackers: `NAME` or `NAME@LABEL` each.
        enhancers: likewise; "none" is the plain tracker.
        options: by `NAME[@LABEL]`, then by option.
        weights: path by `NAME[@LABEL]`.
        scope: what is enhanced, for all; None leaves each tracker its own default.
        device: where networks run.
        backend: what runs networks, for all that have this option.
        precision: what the backend computes in, likewise.

    Raises:
        UsageError: a name twice, options or weights for something that is not run, or a backend
            that is not installed.
        UnknownPlugin, InvalidOption: as the registry says.
    """
    options, weights = options or {}, weights or {}
    tracker_specs = plugin_specs("tracker", trackers, options, weights)
    enhancer_specs = plugin_specs("enhancer", enhancers, options, weights)
    refuse_unused((*tracker_specs, *enhancer_specs), options, weights)
    if scope:
        for spec in tracker_specs:
            if spec.options.get("scope", scope) != scope:
                msg = f"scope {scope} for all, but {spec.title}.scope={spec.options['scope']}"
                raise UsageError(msg)
        tracker_specs = [replace(s, options={**s.options, "scope": scope}) for s in tracker_specs]
    tracker_specs = [with_backend(s, "tracker", backend, precision) for s in tracker_specs]
    enhancer_specs = [with_backend(s, "enhancer", backend, precision) for s in enhancer_specs]
    backends_of(backend, device, precision)
    for tracker_spec in tracker_specs:
        resolve_options(load_plugin(tracker_spec.name, "tracker"), tracker_spec.options)
    for enhancer_spec in enhancer_specs:
        resolve_options(load_plugin(enhancer_spec.name, "enhancer"), enhancer_spec.options)
    return [
        Combination(tracker, None if enhancer.title == "none" else enhancer, device)
        for tracker in tracker_specs
        for enhancer in enhancer_specs
    ]


def with_backend(
    spec: PluginSpec, kind: Kind, backend: BackendWish, precision: Precision
) -> PluginSpec:
    """The plugin run by a backend, where it has that option and none was given for it alone."""
    known = plugin_options(load_plugin(spec.name, kind))
    wanted = {"backend": backend, "precision": precision}
    chosen = {key: value for key, value in wanted.items() if key in known}
    return replace(spec, options={**chosen, **spec.options})


def as_begun(combination: Combination, stored: Manifest | None) -> Combination:
    """A combination for a run that was begun: "auto" is the backend that it was begun with."""
    if stored is None:
        return combination
    device, enhancer = combination.device, combination.enhancer
    tracker = _spec_as_begun(combination.tracker, "tracker", stored.tracker, device)
    if enhancer is not None and stored.enhancer is not None:
        enhancer = _spec_as_begun(enhancer, "enhancer", stored.enhancer, device)
    return replace(combination, tracker=tracker, enhancer=enhancer)


def _spec_as_begun(spec: PluginSpec, kind: Kind, stored: PluginRecord, device: str) -> PluginSpec:
    if spec.options.get("backend") != "auto":
        return spec
    begun = stored.options.get("backend", "torch")
    fastest = getattr(load_plugin(spec.name, kind), "fastest_backends", OPENVINO_FIRST)
    precision = spec.options.get("precision", "float32")
    if begun == backends_of("auto", device, precision, fastest)[0]:
        return spec  # as before, what takes over from it included
    return replace(spec, options={**spec.options, "backend": begun})


def in_torch_for_auto(combination: Combination) -> Combination:
    """A combination for a device that is not here, so that nobody knows what "auto" would be."""

    def chosen(spec: PluginSpec) -> PluginSpec:
        if spec.options.get("backend") != "auto":
            return spec
        return replace(spec, options={**spec.options, "backend": "torch"})

    enhancer = combination.enhancer
    return replace(
        combination, tracker=chosen(combination.tracker), enhancer=enhancer and chosen(enhancer)
    )


def refuse_unused(
    specs: Iterable[PluginSpec],
    options: Mapping[str, Mapping[str, Any]],
    weights: Mapping[str, str],
) -> None:
    """Raise `UsageError` where options or weights are given for something that is not run."""
    titles = [spec.title for spec in specs]
    for what, given in (("options", options), ("weights", weights)):
        for title in given:
            if title not in titles:
                msg = f"{what} for {title}, which is not run{closest(title, titles)}"
                raise UsageError(msg)


def plugin_specs(
    kind: Kind,
    titles: Iterable[str],
    options: Mapping[str, Mapping[str, Any]],
    weights: Mapping[str, str],
) -> list[PluginSpec]:
    """What is asked for by `NAME[@LABEL]`, each with its own options and weights.

    Raises:
        UsageError: one is neither `NAME` nor `NAME@LABEL`, or is named twice.
    """
    specs: dict[str, PluginSpec] = {}
    for title in titles:
        try:
            spec = PluginSpec.parse(title)
        except UsageError as error:
            near = closest(title.lower(), list_plugins(kind))
            msg = f"{error}{near}"
            raise UsageError(msg) from None
        if title in specs:
            msg = f"{title} is named twice; give one of them a label ({spec.name}@LABEL)"
            raise UsageError(msg)
        given = dict(options.get(title, {}))
        specs[title] = replace(spec, options=given, weights=weights.get(title))
    return list(specs.values())


def describe(
    combination: Combination,
    tracker: Tracker,
    enhancer: Enhancer | None,
    dataset: DatasetRecord,
    threads: int,
    on_bad_frame: OnBadFrame = "error",
    batch: int = 1,
) -> Manifest:
    """The manifest of a created combination."""
    record = None
    if combination.enhancer is not None and enhancer is not None:
        record = plugin_record(combination.enhancer, enhancer)
    return Manifest(
        dataset=dataset,
        tracker=plugin_record(combination.tracker, tracker),
        enhancer=record,
        scope=tracker.scope,
        device=combination.device.partition(":")[0],
        threads=threads,
        on_bad_frame=on_bad_frame,
        batch=batch,
        repeatable=tracker.card.repeatable and (record is None or record.repeatable),
    )


def plugin_record(spec: PluginSpec, plugin: Tracker | Enhancer) -> PluginRecord:
    """What a manifest keeps of a created plugin: its full resolved options and its weights."""
    implied = plugin.weights.options if plugin.weights else {}  # by registered weights
    options = resolve_options(type(plugin), {**implied, **spec.options})
    for key in [key for key, value in options.items() if value in (None, "auto")]:
        chosen = getattr(plugin, key, None)  # what the plugin made of "as you like"
        options[key] = chosen if isinstance(chosen, bool | int | float | str) else None
    return PluginRecord(
        name=spec.name,
        label=spec.label,
        options=options,
        weights=_weights_record(plugin.weights),
        repeatable=plugin.card.repeatable,
    )


def untouched_options(
    combination: Combination, tracker: Tracker, enhancer: Enhancer | None
) -> frozenset[tuple[str, str]]:
    """(`NAME[@LABEL]`, option) of all options of a created combination at their defaults."""
    return frozenset(
        (spec.title, key)
        for spec, plugin in ((combination.tracker, tracker), (combination.enhancer, enhancer))
        if spec is not None and plugin is not None
        for key in options_at_default(spec, plugin)
    )


def options_at_default(spec: PluginSpec, plugin: Tracker | Enhancer) -> frozenset[str]:
    """The options of a created plugin that are at their defaults."""
    usual = resolve_options(type(plugin), {})
    implied = plugin.weights.options if plugin.weights else {}
    chosen = resolve_options(type(plugin), {**implied, **spec.options})
    made = plugin_record(spec, plugin).options  # "auto" may have become the default
    return frozenset(key for key in chosen if usual[key] in (chosen[key], made[key]))


def _weights_record(weights: Weights | None) -> WeightsRecord | None:
    if weights is None:
        return None
    path = str(weights.path) if weights.path else ""
    return WeightsRecord(weights.origin, path, weights.sha256, weights.known_as)
