"""The rules by which attributes are computed, with every threshold an option.

Fast motion, low resolution, scale variation, aspect ratio change and full occlusion of `uav123`
give all 123 published labels of UAV123 each.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

from nat2024.errors import InvalidOption, UsageError
from nat2024.measures import UNEVEN_LIGHT_STOPS
from nat2024.types import closest


@dataclass(frozen=True, slots=True)
class AttributeRules:
    """Thresholds of computed attributes. Areas are width x height in pixels of the image.

    Attributes:
        name: of the set of rules.
        fast_step: FM where the centre moves more than this in one frame; in pixels, or in square
            roots of the box's area where `fast_step_relative`.
        fast_step_relative: see `fast_step`.
        low_area: LR where the area falls below this.
        scale_change: SV where the area is more than this many times the first one, or less than
            its inverse.
        aspect_change: ARC, likewise for width / height.
        small_area: targets whose first box is below this are in the smallest size bin.
        large_area: targets whose first box is above this are in the largest size bin.
        low_light: LAI where the mean grey level (0..255) around the target is below this.
        low_light_context: sides of the region for `low_light` over those of the box.
        light_ratio: IV where the grey level of the box in one frame, plus `light_floor`, is more
            than this many times that in another.
        light_floor: added to grey levels before their ratio, so that noise in the dark is none.
        light_change: IV where the grey level of the box changes by more than this
        light_window: within this many frames.
        uneven_light: UL where the spread of light over the frame, in stops, reaches this.
    """

    name: str = "uav123"
    fast_step: float = 20.0
    fast_step_relative: bool = False
    low_area: float = 400.0
    scale_change: float = 2.0
    aspect_change: float = 2.0
    small_area: float = 400.0
    large_area: float = 1000.0
    low_light: float = 20.0
    low_light_context: float = 2.0
    light_ratio: float = 2.0
    light_floor: float = 10.0
    light_change: float = 30.0
    light_window: int = 30
    uneven_light: float = UNEVEN_LIGHT_STOPS

    @property
    def size_bins(self) -> tuple[str, str, str]:
        """Names of the size bins, smallest first."""
        low, high = f"{self.small_area:g}", f"{self.large_area:g}"
        return f"area<{low}", f"area{low}-{high}", f"area>{high}"

    @property
    def box_attributes(self) -> tuple[str, ...]:
        """Attributes that boxes alone give."""
        return ("FM", "LR", "SV", "ARC", "FOC", *self.size_bins)

    @property
    def pixel_attributes(self) -> tuple[str, ...]:
        """Attributes that need the frames."""
        return ("LAI", "IV", "UL")

    def with_options(self, options: Mapping[str, str]) -> "AttributeRules":
        """The same rules with other thresholds, read from texts.

        Raises:
            InvalidOption: no such threshold, or no number of its kind.
        """
        known = [field.name for field in fields(self) if field.name != "name"]
        values: dict[str, float | bool] = {}
        for key, text in options.items():
            if key not in known:
                msg = f"attribute rules have no option {key!r}{closest(key, known)}"
                raise InvalidOption(msg)
            values[key] = _read(key, text, getattr(self, key))
        changed = replace(self, **values)  # type: ignore[arg-type]
        if changed.small_area > changed.large_area:
            msg = f"small_area={changed.small_area:g} is above large_area={changed.large_area:g}"
            raise InvalidOption(msg)
        return changed


def _read(key: str, text: str, default: float) -> float | bool:
    words = {"true": True, "false": False}
    if isinstance(default, bool) and text.lower() in words:
        return words[text.lower()]
    try:
        value = int(text) if isinstance(default, int) else float(text)
    except ValueError:
        value = -1
    # "not >= 0" also refuses NaN
    if isinstance(default, bool) or not value >= 0:
        kind = "true or false" if isinstance(default, bool) else "a number of at least 0"
        msg = f"attribute option {key}={text}: expected {kind}"
        raise InvalidOption(msg)
    return value


RULES: Mapping[str, AttributeRules] = MappingProxyType(
    {
        "uav123": AttributeRules(),
        "lasot": AttributeRules("lasot", fast_step=1.0, fast_step_relative=True, low_area=1000.0),
        "uavdark135": AttributeRules("uavdark135", low_area=20.0),
    }
)
"""Sets of rules by name. `lasot`: FM, LR as LaSOT words them; they give 71 % and 96 % of its
published labels, SV and ARC 98 % and 99 %. `uavdark135`: LR as UAVDark135's text reads literally,
fewer than 20 pixels in total; hardly any target is that small, and a side of 20 pixels, as in
`uav123`, is probably meant."""


def get_rules(name: str = "uav123", options: Mapping[str, str] | None = None) -> AttributeRules:
    """Rules by name, with thresholds changed by `options`.

    Raises:
        UsageError: no such set of rules.
        InvalidOption: no such threshold, or no number of its kind.
    """
    if name not in RULES:
        msg = f"no attribute rules {name!r}{closest(name, RULES)}; known: {', '.join(RULES)}"
        raise UsageError(msg)
    return RULES[name].with_options(options or {})


def attribute_meanings(rules: AttributeRules) -> dict[str, str]:
    """What each computed attribute means under these rules, by its abbreviation."""
    smallest, middle, largest = rules.size_bins
    step = f"{rules.fast_step:g} {'box sizes' if rules.fast_step_relative else 'pixels'}"
    return {
        "FM": f"fast motion: the centre moves more than {step} in one frame",
        "LR": f"low resolution: the box has fewer than {rules.low_area:g} pixels",
        "SV": f"scale variation: the area changes more than {rules.scale_change:g} times",
        "ARC": f"aspect ratio change: width / height changes over {rules.aspect_change:g} times",
        "FOC": "full occlusion: the target is absent in a frame (NaN)",
        smallest: f"the first box has fewer than {rules.small_area:g} pixels",
        middle: f"the first box has {rules.small_area:g} to {rules.large_area:g} pixels",
        largest: f"the first box has more than {rules.large_area:g} pixels",
        "LAI": f"low ambient intensity: mean grey around the target below {rules.low_light:g}",
        "IV": (
            f"illumination variation: grey of the box changes {rules.light_ratio:g} times, "
            f"or by {rules.light_change:g} in {rules.light_window} frames"
        ),
        "UL": f"uneven light: it differs by {rules.uneven_light:g} stops over the frame",
    }
