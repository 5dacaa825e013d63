"""How the bundled sample `night_mini` is rendered.

Its seeds are the range 900000 to 900099, which belongs to it alone: nothing that a network is
trained on may be rendered from them.
"""

from nat2024.night.sequence import NightSettings

SEEDS = range(900_000, 900_100)
"""Seeds that are kept for the sample, and out of all training."""

QUALITY = 50
"""JPEG quality of its frames."""

_SIZE = (480, 270)

SAMPLE: tuple[NightSettings, ...] = (
    NightSettings("car", 73, _SIZE, seed=900_000, place="crossing"),
    NightSettings("person", 61, _SIZE, seed=900_011, place="plaza", out_of_view=True),
    NightSettings("bus", 62, _SIZE, seed=900_020, occlusion="partial"),
    NightSettings("bike", 71, _SIZE, seed=900_030, occlusion="full"),
    NightSettings("boat", 63, _SIZE, seed=900_040),
    NightSettings("truck", 64, _SIZE, seed=900_050, occlusion="partial", out_of_view=True),
)
"""Its sequences, named `car1`, `person1`, `bus1`, `bike1`, `boat1` and `truck1`.

All lengths differ, so that no other rendered dataset is taken for it by names and lengths.
"""
