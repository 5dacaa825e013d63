"""Weights that a user registers once, so that a plugin finds them without being told a path.

A file is registered by loading it into the plugin it is for, so that keys, shapes and safety are
checked by what will use it. PyTorch checkpoints are kept as safetensors, anything else as a copy.
"""

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nat2024.cards import Card
from nat2024.errors import (
    InvalidOption,
    NatBenchError,
    UsageError,
    WeightsMismatch,
    WeightsMissing,
)
from nat2024.files import expand, write_atomic
from nat2024.interfaces import Enhancer, Tracker
from nat2024.registry import (
    create_enhancer,
    create_tracker,
    load_plugin,
    plugin_kind,
    plugin_options,
    resolve_options,
    takes_weights,
)
from nat2024.zoo import (
    WeightsSpec,
    bundled_path,
    check_finite,
    read_checkpoint,
    registered,
    sha256_of,
)
from nat2024.zoo.registered import RegisteredWeights, describe_options

if TYPE_CHECKING:
    from os import PathLike

    import torch


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of the check of one registered entry.

    Attributes:
        plugin: name of the tracker or enhancer.
        options: options that the weights belong to.
        record: file of the record.
        known_as: which published file it is, empty where it is none.
        problem: what is wrong, empty where all is well.
    """

    plugin: str
    options: Mapping[str, Any]
    record: Path
    known_as: str
    problem: str = ""

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problem


def import_weights(
    name: str, path: "str | PathLike[str]", options: Mapping[str, Any] | None = None
) -> RegisteredWeights:
    """Register a weights file (or folder) for a plugin.

    The plugin loads it, with `options`; then its state dict is written as safetensors, read back
    and compared. A folder, a safetensors file, a file that is no PyTorch checkpoint, and one of a
    plugin without `.model` are copied as they are. Entries with other options stay; one with the
    same is replaced.

    Args:
        name: the tracker or enhancer.
        path: what it takes as `weights`.
        options: its options; `variant`, where it has that, is kept with the weights in any case,
            and is taken from the card where the file is a published one.

    Raises:
        UnknownPlugin, InvalidOption: no such plugin or option, or it takes no weights.
        WeightsMissing: no such file.
        WeightsMismatch: not safe to load, of another network or variant, or not finite.
        Unwritable: the folder of weights cannot be written.
    """
    cls = load_plugin(name, plugin_kind(name))
    source = expand(path)
    given = _checked_options(cls, options or {})
    if not takes_weights(cls):
        msg = f"{name} takes no weights"
        raise InvalidOption(msg)
    if not source.exists():
        msg = f"weights of {name}: {source}: no such file"
        raise WeightsMissing(msg)
    given = _with_variant_of_file(cls, source, given)
    plugin = _create(name, source, given)
    if plugin.weights is None or plugin.weights.path is None:
        msg = f"{name} did not take the weights {source}; give it no weights"
        raise InvalidOption(msg)
    variant = getattr(plugin, "variant", None)
    if isinstance(variant, str) and "variant" in plugin_options(cls):
        given["variant"] = variant
    record = _keep(plugin, source, given)
    registered.store(record)
    return record


def list_weights(name: str | None = None) -> list[RegisteredWeights]:
    """Registered weights of one plugin or of all, by name and options.

    Raises:
        WeightsMismatch: a record cannot be read; `verify_weights` shows all that are so.
    """
    return registered.list_registered(name)


def verify_weights(name: str | None = None) -> list[Verdict]:
    """Check registered weights: digest, and whether their plugin still loads them.

    Raises:
        WeightsMissing: a name is given, and nothing is registered for it.
    """
    files = registered.record_files(name)
    if name is not None and not files:
        raise WeightsMissing(_nothing_for(name))
    return [_verify(path) for path in files]


def remove_weights(
    name: str, options: Mapping[str, Any] | None = None, *, every: bool = False
) -> list[RegisteredWeights]:
    """Remove registered weights of a plugin, which need not be installed any more.

    Args:
        name: the plugin.
        options: which entry; only those that have all of these.
        every: whether several entries may go.

    Returns:
        What was removed.

    Raises:
        WeightsMissing: there are none such.
        UsageError: there are several, and `every` is not set.
    """
    wanted = options or {}
    # options are compared as texts: nobody may know the types of a plugin that is gone
    found = [
        one
        for one in registered.list_registered(name)
        if all(str(one.options.get(key)) == str(value) for key, value in wanted.items())
    ]
    if not found:
        raise WeightsMissing(_nothing_for(name, describe_options(wanted)))
    if len(found) > 1 and not every:
        choices = "; ".join(describe_options(one.options) or "no options" for one in found)
        msg = f"several weights are registered for {name} ({choices}); name one, or take all"
        raise UsageError(msg)
    for one in found:
        registered.remove(one)
    return found


def describe_weights_at_hand(name: str, card: Card) -> str:
    """In a word or two, what a plugin would take where it is given no weights.

    Such as "registered: model.pth", "bundled: compact.safetensors"; "none" where weights are
    needed, empty where the plugin takes none.
    """
    try:
        found = [one.known_as or Path(one.source).name for one in list_weights(name)]
    except WeightsMismatch:
        return "registered, but not readable"
    if found:
        return f"registered: {', '.join(found)}"
    bundled = [file.name for file in card.weights if bundled_path(file)]
    if bundled:
        return f"bundled: {', '.join(bundled)}"
    return "none" if card.needs_weights else ""


def _create(name: str, weights: WeightsSpec, options: Mapping[str, Any]) -> "Tracker | Enhancer":
    if plugin_kind(name) == "tracker":
        return create_tracker(name, weights=weights, **options)
    return create_enhancer(name, weights=weights, **options)


def _checked_options(cls: type[Any], options: Mapping[str, Any]) -> dict[str, Any]:
    resolved = resolve_options(cls, options)
    for key in options:
        if not isinstance(resolved[key], bool | int | float | str | None):
            msg = f"option {cls.name}.{key} cannot be kept with weights"
            raise InvalidOption(msg)
    return {key: resolved[key] for key in options}


def _with_variant_of_file(cls: type[Any], source: Path, given: dict[str, Any]) -> dict[str, Any]:
    """Options with the variant that a published file belongs to, where it belongs to one."""
    file = cls.card.published_file(sha256_of(source)) if source.is_file() else None
    if file is None or not file.variant or "variant" not in plugin_options(cls):
        return dict(given)
    if given.get("variant") not in (None, file.variant):
        msg = f"{source}: is {file.name} of variant {file.variant}, not of {given['variant']}"
        raise WeightsMismatch(msg)
    return {**given, "variant": file.variant}


def _keep(plugin: "Tracker | Enhancer", source: Path, options: dict[str, Any]) -> RegisteredWeights:
    """Write the weights of a plugin that has loaded `source`, and make sure of what was written."""
    assert plugin.weights is not None
    state = _state_of(plugin, source)
    convert = state is not None and source.suffix.lower() != ".safetensors"
    folder = registered.plugin_folder(plugin.name)
    name = f"{registered.entry_name(options)}-{plugin.weights.sha256[:12]}"
    if state is not None:
        check_finite(state, str(source))
    if state is not None and convert:
        path = folder / f"{name}.safetensors"
        write_atomic(path, _safetensors_of(state))
    else:
        path = folder / (name + source.suffix.lower() if source.is_file() else name)
        registered.copy_files(source, plugin.weights.files, path)
    try:
        _check_copy(plugin, path, options, state)
    except NatBenchError:
        registered.discard(path)
        raise
    return RegisteredWeights(
        plugin=plugin.name,
        options=options,
        source=str(source.resolve()),
        source_sha256=plugin.weights.sha256,
        known_as=plugin.weights.known_as,
        file=path.name,
        form="safetensors" if convert else "copy",
        sha256=sha256_of(path),
        bytes=_size_of(path),
        entries=len(state or ()),
        imported=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    )


def _state_of(plugin: "Tracker | Enhancer", source: Path) -> "dict[str, torch.Tensor] | None":
    """What was read from the source; None where it is no PyTorch or safetensors file."""
    model = getattr(plugin, "model", None)
    if model is None or not source.is_file():
        return None
    try:
        read_checkpoint(source)
    except WeightsMismatch:  # a file form of the plugin's own, which the plugin has read
        return None
    # tensors that a network lists twice share their memory, which safetensors refuses
    return {key: value.detach().clone() for key, value in model.state_dict().items()}


def _safetensors_of(state: "dict[str, torch.Tensor]") -> bytes:
    from safetensors.torch import save

    return save({key: value.contiguous() for key, value in state.items()})


def _check_copy(
    plugin: "Tracker | Enhancer",
    path: Path,
    options: Mapping[str, Any],
    state: "Mapping[str, torch.Tensor] | None",
) -> None:
    """Raise `WeightsMismatch` where the stored file does not give what the source gave."""
    import torch

    again = _create(plugin.name, path, options)
    if state is None:
        same = again.weights is not None and plugin.weights is not None
        same = same and again.weights.sha256 == plugin.weights.sha256  # type: ignore[union-attr]
    else:
        read: dict[str, torch.Tensor] = again.model.state_dict()  # type: ignore[union-attr]
        same = all(torch.equal(read[key], value) for key, value in state.items())
    if not same:
        msg = f"{path}: {plugin.name} reads other weights from it than from the original"
        raise WeightsMismatch(msg)


def _size_of(path: Path) -> int:
    files = [path] if path.is_file() else path.rglob("*")
    return sum(file.stat().st_size for file in files if file.is_file())


def _verify(path: Path) -> Verdict:
    plugin = path.parent.name
    try:
        record = registered.read_record(path)
    except WeightsMismatch as error:
        return Verdict(plugin, {}, path, "", str(error))
    verdict = Verdict(plugin, record.options, path, record.known_as)
    try:
        created = _create(plugin, None, record.options)
    except NatBenchError as error:
        return _with_problem(verdict, str(error))
    used = created.weights.path if created.weights else None
    if used != record.path:
        return _with_problem(
            verdict, f"{plugin} takes {used} with these options, not {record.path}"
        )
    return verdict


def _with_problem(verdict: Verdict, problem: str) -> Verdict:
    return Verdict(verdict.plugin, verdict.options, verdict.record, verdict.known_as, problem)


def _nothing_for(name: str, options: str = "") -> str:
    with_options = f" with {options}" if options else ""
    there = [
        f"{one.plugin} ({describe_options(one.options)})" if one.options else one.plugin
        for one in registered.list_registered()
    ]
    holds = f"registered are {', '.join(there)}" if there else "nothing is registered"
    return f"no weights are registered for {name}{with_options}; {holds}"
