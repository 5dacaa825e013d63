"""Names of published result folders, as (tracker, enhancer).

Sources: the result folders of the repositories vision4robotics/LDEnhancer, SCT, DarkLighter and
UDAT. All forms occur there: `NAME_ENH` (SCT, DarkLighter), `NAME-ENH`, `ENH-NAME` (LDEnhancer).
"""

import re
from collections.abc import Iterator

NONE = "none"

_TRACKERS = {
    "hift": "hift",
    "lpat": "lpat",
    "siamapn": "siamapn",
    "siamapnpp": "siamapnpp",
    "siamrpnpp": "siamrpnpp",
    "siamrpnpp_a": "siamrpnpp",  # UDAT: with AlexNet
    "siamrpn_alex_dwxcorr": "siamrpnpp",  # the name of its configuration in pysot
    "nanotrack": "nanotrack",
    "fdsst": "fdsst",
    "kcf": "kcf",
    "mosse": "mosse",
    "mil": "mil",
}
"""Trackers of nat-bench by the names that others give them, as `_key` has them."""

_ENHANCERS = {
    "lde": "ldenhancer",
    "ldenhancer": "ldenhancer",
    "dce": "dce",  # Zero-DCE, of which nat-bench has only the extended form
    "zero_dce": "dce",
    "zerodce": "dce",
    "dcepp": "dcepp",
    "zero_dcepp": "dcepp",
    "zerodcepp": "dcepp",
    "darklighter": "darklighter",
    "highlightnet": "highlightnet",
    "sct": "sct",
    "ruas": "ruas",
    "kindpp": "kindpp",
    "lime": "lime",
    "enlightengan": "enlightengan",
    "llve": "llve",
    "gamma": "gamma",
    "clahe": "clahe",
    "he": "he",
    "msrcr": "msrcr",
    "adtrack_tonemap": "adtrack_tonemap",
    "tone_curve": "tone_curve",
}

TITLES = {
    "dce": "Zero-DCE",
    "dimp18": "DiMP-18",
    "dimp50": "DiMP-50",
    "prdimp50": "PrDiMP-50",
}
"""What papers call those that nat-bench does not have, by the names that `split_name` gives."""

_OWN = re.compile(r"(?P<tracker>[^+]+)\+(?P<enhancer>[^+]+)")
_LABEL = re.compile(r"(?P<name>[^@]+)(?P<label>@.*)?")


def split_name(name: str) -> tuple[str, str]:
    """(tracker, enhancer) of a result folder, by the names that nat-bench has for them.

    Forms: `TRACKER+ENHANCER` with labels (nat-bench's own), `TRACKER_ENH`, `TRACKER-ENH`,
    `ENH-TRACKER` and `ENH_TRACKER`, where ENH is a known enhancer in any case. Trackers that
    nat-bench does not have keep the name they came with; a name of no such form stays whole, with
    the enhancer "none".
    """
    own = _OWN.fullmatch(name)
    if own and not name.endswith("+"):
        return _with_label(own["tracker"], _TRACKERS), _with_label(own["enhancer"], _ENHANCERS)
    if _key(name) in _TRACKERS:
        return _TRACKERS[_key(name)], NONE
    for tracker, enhancer in _partings(name):
        if _key(enhancer) in _ENHANCERS and tracker:
            return _TRACKERS.get(_key(tracker), tracker), _ENHANCERS[_key(enhancer)]
    return _with_label(name, _TRACKERS), NONE


def _partings(name: str) -> Iterator[tuple[str, str]]:
    """All (tracker, enhancer) that a separator can part, the longest enhancer first."""
    places = [i for i, character in enumerate(name) if character in "-_"]
    for place in places:
        yield name[:place], name[place + 1 :]
    for place in reversed(places):
        yield name[place + 1 :], name[:place]


def _with_label(text: str, known: dict[str, str]) -> str:
    """The known name of `NAME[@LABEL]`, with its label."""
    match = _LABEL.fullmatch(text)
    if match is None:
        return text
    return known.get(_key(match["name"]), match["name"]) + (match["label"] or "")


def _key(name: str) -> str:
    return name.lower().replace("++", "pp").replace("-", "_")


_DATASETS = {
    "nat2021": "nat2021_test",
    "nat2021l": "nat2021_l_test",
    "nat2021test": "nat2021_test",
    "nat2021ltest": "nat2021_l_test",
}
_OTHER_DATASETS = frozenset(
    (
        *("uavdark135", "uavdark70", "darktrack2021", "nat20241", "nat20242", "dtb70", "uav123"),
        *("uav12310fps", "uav20l", "uavdt", "visdrone", "otb", "otb50", "otb100", "otb2013"),
        *("otb2015", "lasot", "lasotext", "got10k", "trackingnet", "tnl2k", "nfs", "tc128", "vot"),
        *("vot2016", "vot2018", "vot2018lt", "vot2019", "vot2020", "llot", "uavtrack112"),
    )
)


_CONTAINERS = frozenset(
    (
        "results",
        "trackingresults",
        "resultsope",
        "rawresults",
        "others",
        "overall",
        "againstotheren",
    )
)
_ANNOTATIONS = frozenset(
    ("anno", "annos", "annorevise", "annotation", "annotations", "att", "groundtruth", "gt")
)


def names_dataset(name: str, dataset: str | None = None) -> bool:
    """Whether a folder name is that of a dataset: of `dataset` where given, else of any known."""
    key = _plain(name)
    if dataset is None:
        return key in _DATASETS or key in _OTHER_DATASETS
    return _plain(_DATASETS.get(key, name)) == _plain(dataset)


def names_container(name: str) -> bool:
    """Whether a folder name tells of results, and of no dataset or tracker."""
    return _plain(name) in _CONTAINERS


def names_annotation(name: str) -> bool:
    """Whether a folder name tells of ground truth, which is no result."""
    return _plain(name) in _ANNOTATIONS


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
