"""What a target is and does, as far as the name of its sequence tells.

The names of NAT2024-2, UAVDark135, UAVDark70 and DarkTrack2021 begin with the target (`car_9d`,
`traffic_light`); those of NAT2021 and NAT2024-1 are numbers and tell nothing. Section IV of the
NAT2024-2 paper names the activities cycling, running and ball games.
"""

import re

_CATEGORIES = {
    "basketballplayer": "person",
    "bicycle": "bike",
    "bike": "bike",
    "boat": "boat",
    "bridge": "bridge",
    "building": "building",
    "bus": "bus",
    "car": "car",
    "dancing": "person",
    "dog": "dog",
    "gir": "person",  # spelled so in UAVDark135
    "girl": "person",
    "group": "group",
    "house": "building",
    "jeep": "car",
    "jogging_man": "person",
    "minibus": "bus",
    "motor": "motorbike",
    "motorbike": "motorbike",
    "pedestrian": "person",
    "person": "person",
    "roadblock": "roadblock",
    "roadbloack": "roadblock",  # spelled so in NAT2024-2
    "running": "person",
    "running_girl": "person",
    "running_man": "person",
    "ship": "ship",
    "signpost": "traffic_sign",
    "skating": "person",
    "subway": "subway",
    "taxi": "car",
    "tennisplayer": "person",
    "tower": "tower",
    "traffic_light": "traffic_light",
    "traffic_sign": "traffic_sign",
    "tricycle": "tricycle",
    "truck": "truck",
    "valleyballplayer": "person",
    "van": "van",
    "vehicle": "vehicle",
    "volleyballplayer": "person",
}
_ACTIVITIES = {
    "basketballplayer": "ball game",
    "bicycle": "cycling",
    "bike": "cycling",
    "dancing": "dancing",
    "jogging_man": "running",
    "running": "running",
    "running_girl": "running",
    "running_man": "running",
    "skating": "skating",
    "tennisplayer": "ball game",
    "valleyballplayer": "ball game",
    "volleyballplayer": "ball game",
}
_NUMBER = re.compile(r"(?:(?:_l|[_-])?[0-9]+[a-z]?|_l)$")  # car_9d, car_l1, bike12, pedestrian_l


def category_of(name: str) -> str:
    """What the target of a sequence of this name is, empty where the name does not tell."""
    return _CATEGORIES.get(_stem(name), "")


def activity_of(name: str) -> str:
    """What the target of a sequence of this name does, empty where the name does not tell."""
    return _ACTIVITIES.get(_stem(name), "")


def _stem(name: str) -> str:
    stem = name.lower()
    while stem not in _CATEGORIES:
        shorter = _NUMBER.sub("", stem).rstrip("_-")
        if shorter == stem:
            return stem
        stem = shorter
    return stem
