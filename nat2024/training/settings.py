"""All that decides how a network is trained, as one frozen record, and how texts set it."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from nat2024.errors import InvalidOption
from nat2024.types import closest

Count = Annotated[int, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Amount = Annotated[float, msgspec.Meta(ge=0.0)]

_Record = TypeVar("_Record", bound=msgspec.Struct)
_Values = TypeVar("_Values", bound=Mapping[str, Any])


class TrainingSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How a network is trained, whatever it is.

    Attributes:
        steps: optimisation steps.
        epochs: rounds through the data; where above 0, `steps` is not looked at.
        batch_size: samples a step; what a source of batches is made with.
        optimiser: "adamw" (decoupled weight decay), "adam" or "sgd" (with `momentum`).
        learning_rate: of the optimiser, reached after `warm_up`.
        betas: of Adam and AdamW.
        epsilon: of Adam and AdamW.
        momentum: of SGD.
        weight_decay: of the optimiser.
        schedule: "constant", or "cosine" down to `final_rate` at the last step.
        warm_up: steps over which the learning rate grows linearly.
        final_rate: share of the learning rate that is left at the end of "cosine".
        clip: largest norm of all gradients together; 0 for none.
        average: decay of the exponential mean of the weights, at step n at most n / (n + 10); 0
            for none. Where there is one it is what is validated and what comes out.
        seed: of initial weights, dropout, order and augmentation.
        mixed_precision: half precision where it is safe; on CUDA only.
        checkpoint_every: steps between checkpoints; 0 for one an epoch.
        keep: how many of the last checkpoints are kept; 0 for all. The best one is kept besides.
        validate_every: steps between validations; 0 for one at every checkpoint.
        best: number of the validation whose best step's weights come out, such as "auc", or
            "-loss" where less is better; empty for the last step's.
        patience: stop after so many validations without a better number; 0 for never.
        log_every: steps between rows of the curves; their mean is written.
    """

    steps: Annotated[int, msgspec.Meta(ge=1)] = 1000
    epochs: Count = 0
    batch_size: Annotated[int, msgspec.Meta(ge=1)] = 4
    optimiser: Literal["adamw", "adam", "sgd"] = "adamw"
    learning_rate: Amount = 1e-4
    betas: tuple[float, float] = (0.9, 0.999)
    epsilon: Amount = 1e-8
    momentum: Share = 0.9
    weight_decay: Amount = 1e-4
    schedule: Literal["constant", "cosine"] = "constant"
    warm_up: Count = 0
    final_rate: Share = 0.0
    clip: Amount = 0.0
    average: Share = 0.0
    seed: Count = 0
    mixed_precision: bool = False
    checkpoint_every: Count = 0
    keep: Count = 0
    validate_every: Count = 0
    best: str = ""
    patience: Count = 0
    log_every: Annotated[int, msgspec.Meta(ge=1)] = 10


_MAY_CHANGE = ("checkpoint_every", "keep", "validate_every", "best", "patience", "log_every")


def identity_of(settings: TrainingSettings) -> dict[str, Any]:
    """The settings that a training cannot be resumed with others of."""
    fixed: dict[str, Any] = msgspec.to_builtins(settings)
    for name in _MAY_CHANGE:
        del fixed[name]
    if settings.schedule == "constant":  # the steps done do not depend on how many will follow
        del fixed["steps"], fixed["epochs"]
    return fixed


def set_values(records: Iterable[_Record], values: Mapping[str, Any]) -> tuple[_Record, ...]:
    """The same records with new values, each for the record that has a setting of its name.

    Args:
        records: settings, of the loop or of anything else; no two share a name.
        values: by name; texts are read as what the setting is: "3e-4", "true", "0.9,0.99".

    Raises:
        InvalidOption: no record has such a setting (names the closest), or a value does not fit.
    """
    changed = list(records)
    for key, value in values.items():
        for place, record in enumerate(changed):
            if key in record.__struct_fields__:
                changed[place] = _set(record, key, value)
                break
        else:
            known = [name for record in changed for name in record.__struct_fields__]
            msg = f"training has no setting {key!r}{closest(key, known)}"
            msg += f"; it has {', '.join(sorted(known))}"
            raise InvalidOption(msg)
    return tuple(changed)


def choose_preset(name: str, preset: str, presets: Mapping[str, _Values]) -> _Values:
    """The values of a preset.

    Args:
        name: of the plugin, for the message.
        preset: its name.
        presets: all, by name.

    Raises:
        InvalidOption: there is no such preset; names the closest.
    """
    if preset not in presets:
        msg = f"{name} has no training preset {preset!r}{closest(preset, presets)}"
        msg += f"; it has {', '.join(sorted(presets))}"
        raise InvalidOption(msg)
    return presets[preset]


def _set(record: _Record, key: str, value: Any) -> _Record:
    fields: dict[str, Any] = msgspec.to_builtins(record)
    if isinstance(value, str) and isinstance(fields[key], list | tuple):
        value = value.split(",")
    try:
        return msgspec.convert({**fields, key: value}, type(record), strict=False)
    except msgspec.ValidationError as error:
        reason = str(error).split(" - at", 1)[0]
        msg = f"training setting {key}={value}: {reason[:1].lower()}{reason[1:]}"
        raise InvalidOption(msg) from None
