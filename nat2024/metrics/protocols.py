"""Named evaluation protocols and their options."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from nat2024.errors import UsageError
from nat2024.types import closest

LengthRule: TypeAlias = Literal["error", "pad", "cut"]
"""What to do where result and ground truth differ in length."""

LENGTH_RULES: Final[tuple[LengthRule, ...]] = ("error", "pad", "cut")

_DESCRIPTIONS: Final[dict[str, str]] = {
    "pysot": "pysot toolkit, as in the LDEnhancer code: every row counts, no target fails "
    "success and passes precision",
    "otb": "OTB / UAV123 MATLAB: first row replaced, bad rows repeat the previous, no "
    "normalised precision",
    "lasot": "LaSOT MATLAB: as otb, with normalised precision and absent flags",
    "pytracking": "pytracking: first row replaced, short results padded, precision of frames "
    "without target by label",
    "got10k-ope": "GOT-10k toolkit, OPE classes: first row replaced, cut to the shorter, "
    "normalised by max(1, size)",
    "got10k-ao": "GOT-10k itself: average overlap and success rates over the pooled frames, "
    "first row dropped",
    "trackingnet": "TrackingNet: boxes rounded to integers, overlap >= threshold, areas by "
    "trapezoids",
    "strict": "nat-bench: only frames with a target count, first frame left out, overlap >= "
    "threshold",
}
_ALIASES: Final[dict[str, str]] = {"snot": "pysot"}

_OPTIONS: Final[dict[str, tuple[str, ...]]] = {
    "pytracking": ("label", "exclude_invalid", "invalid_rule"),
    "got10k-ope": ("invalid_rule",),
    "got10k-ao": ("frame_size", "cover"),
}
_OPTION_NAMES: Final = ("label", "exclude_invalid", "invalid_rule", "frame_size", "cover")

# first name of each tuple is the canonical one, first tuple of each protocol its default
_INVALID_RULES: Final[dict[str, tuple[tuple[str, ...], ...]]] = {
    "got10k-ope": (("nan", "any-nan", "uav123", "lasot"), ("none", "otb", "dtb70")),
    "pytracking": (("positive", "all-positive"), ("size", "positive-size")),
}


@dataclass(frozen=True, slots=True)
class Protocol:
    """A way to turn boxes into scores, with its options.

    An option that the named protocol does not have must be left at its default.

    Attributes:
        name: `pysot` (alias `snot`), `otb`, `lasot`, `pytracking`, `got10k-ope`, `got10k-ao`,
            `trackingnet` or `strict`.
        label: `pytracking`: the dataset's label. `uav` lets frames without target pass precision
            and allows NaN in the ground truth; `lasot` refuses short results and fails invisible
            frames in normalised precision too; any other label (default "other") fails frames
            without target in precision.
        exclude_invalid: `pytracking`: divide by the frames with a target. As in that toolkit a
            precision can then exceed 1 under label `uav`.
        invalid_rule: which rows of ground truth hold no target; None for the first one named.
            `got10k-ope`: `nan` (its UAV123 and LaSOT classes: any NaN) or `none` (its OTB and
            DTB70 classes). `pytracking`: `positive` (not all four values above 0) or `size` (w or
            h not above 0, as in some forks).
        frame_size: `got10k-ao`: (width, height) in pixels to which boxes are clipped; not
            clipped where None.
        cover: `got10k-ao`: visible share of each frame; frames with 0 leave the score. Where
            None, the flags `visible`, and where these are None too, rows without NaN count.

    Raises:
        UsageError: an unknown name, option or value.

    Example:
        >>> Protocol("pytracking", label="uav", exclude_invalid=True).title
        'pytracking (label=uav, exclude_invalid=True)'
    """

    name: str
    label: str | None = None
    exclude_invalid: bool = False
    invalid_rule: str | None = None
    frame_size: tuple[int, int] | None = None
    cover: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        name = _canonical_name(self.name)
        object.__setattr__(self, "name", name)
        for option in _OPTION_NAMES:
            given = getattr(self, option)
            is_default = given is None or given is False
            if not is_default and option not in _OPTIONS.get(name, ()):
                msg = f"protocol {name} has no option {option}{_options_of(name)}"
                raise UsageError(msg)
        if name == "pytracking":
            label = "other" if self.label is None else str(self.label).lower()
            object.__setattr__(self, "label", label)
        object.__setattr__(self, "exclude_invalid", bool(self.exclude_invalid))
        object.__setattr__(self, "invalid_rule", _canonical_rule(name, self.invalid_rule))
        object.__setattr__(self, "frame_size", _checked_size(self.frame_size))
        object.__setattr__(self, "cover", _checked_cover(self.cover))

    @property
    def title(self) -> str:
        """Name with the options that differ from the default, for tables."""
        default = Protocol(self.name)
        parts = [
            f"{option}={getattr(self, option)}"
            for option in ("label", "exclude_invalid", "invalid_rule")
            if getattr(self, option) != getattr(default, option)
        ]
        return f"{self.name} ({', '.join(parts)})" if parts else self.name

    @property
    def description(self) -> str:
        """What the protocol does, in one line."""
        return _DESCRIPTIONS[self.name]

    @property
    def without_sequence_data(self) -> "Protocol":
        """The same protocol without `frame_size` and `cover`, which belong to one sequence."""
        if self.frame_size is None and self.cover is None:
            return self
        return replace(self, frame_size=None, cover=None)

    def for_sequence(self, frame_size: tuple[int, int] | None) -> "Protocol":
        """The same protocol with a sequence's frame size, where it has that option and none yet."""
        if "frame_size" not in _OPTIONS.get(self.name, ()) or self.frame_size is not None:
            return self
        return replace(self, frame_size=frame_size)


def get_protocol(protocol: "str | Protocol") -> Protocol:
    """The protocol of that name with default options, or the given one itself.

    Raises:
        UsageError: an unknown name; names the closest ones.

    Example:
        >>> get_protocol("snot").name
        'pysot'
    """
    if isinstance(protocol, Protocol):
        return protocol
    plain = _PLAIN.get(protocol) if isinstance(protocol, str) else None
    return plain or Protocol(protocol)


def list_protocols() -> list[str]:
    """Names of all protocols, the default first."""
    return list(_DESCRIPTIONS)


def check_length_rule(rule: str | None) -> "LengthRule | None":
    """`rule` itself where it is one of `LENGTH_RULES` or None, else `UsageError`."""
    for known in LENGTH_RULES:
        if rule == known:
            return known
    if rule is None:
        return None
    msg = f"unknown on_length {rule!r}; known: {', '.join(LENGTH_RULES)}"
    raise UsageError(msg)


def _canonical_name(name: str) -> str:
    if not isinstance(name, str):
        msg = f"a protocol is a name or a Protocol, not {type(name).__name__}"
        raise UsageError(msg)
    plain = name.strip().lower().replace("_", "-")
    plain = _ALIASES.get(plain, plain)
    if plain not in _DESCRIPTIONS:
        names = ", ".join(_DESCRIPTIONS)
        near = closest(plain, [*_DESCRIPTIONS, *_ALIASES])
        msg = f"unknown protocol {name!r}{near or '; known: ' + names}"
        raise UsageError(msg)
    return plain


def _options_of(name: str) -> str:
    options = _OPTIONS.get(name)
    return f"; it has {', '.join(options)}" if options else "; it has none"


def _canonical_rule(name: str, rule: str | None) -> str | None:
    rules = _INVALID_RULES.get(name)
    if rules is None:
        return None
    if rule is None:
        return rules[0][0]
    plain = str(rule).strip().lower().replace("_", "-").replace(" ", "-")
    for names in rules:
        if plain in names:
            return names[0]
    known = ", ".join(names[0] for names in rules)
    msg = f"protocol {name}: unknown invalid_rule {rule!r}; known: {known}"
    raise UsageError(msg)


def _checked_size(size: Iterable[int] | None) -> tuple[int, int] | None:
    if size is None:
        return None
    values = tuple(int(value) for value in size)
    if len(values) != 2 or min(values) < 1:
        msg = f"frame_size must be (width, height) in pixels, not {values}"
        raise UsageError(msg)
    return values[0], values[1]


def _checked_cover(cover: npt.ArrayLike | None) -> tuple[float, ...] | None:
    if cover is None:
        return None
    values = np.asarray(cover, dtype=np.float64)
    if values.ndim != 1:
        msg = f"cover must hold one value a frame, not the shape {values.shape}"
        raise UsageError(msg)
    return tuple(values.tolist())


_PLAIN: Final = {name: Protocol(name) for name in _DESCRIPTIONS}
