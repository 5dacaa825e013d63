"""What the abbreviations of attributes mean, in the words of the papers that publish them."""

import re

from nat2024.datasets.schema import AttributeTerm

_TITLES = {
    "ARC": "aspect ratio change",
    "BC": "background clutter",
    "CM": "camera motion",
    "DEF": "deformation",
    "FM": "fast motion",
    "FOC": "full occlusion",
    "IPR": "in-plane rotation",
    "IV": "illumination variation",
    "LAI": "low ambient intensity",
    "LR": "low resolution",
    "MB": "motion blur",
    "OCC": "occlusion",
    "OPR": "out-of-plane rotation",
    "OV": "out of view",
    "POC": "partial occlusion",
    "SOB": "similar object",
    "SV": "scale variation",
    "UL": "uneven light",
    "VC": "viewpoint change",
}
_NUMBER = r"\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_SIZE_BIN = re.compile(
    rf"area(?:(?P<sign>[<>])(?P<limit>{_NUMBER})|(?P<low>{_NUMBER})-(?P<high>{_NUMBER}))"
)


def attribute_term(name: str) -> AttributeTerm:
    """An attribute with its title, empty where the abbreviation is not known.

    Bins of size are known with any limits, such as `area<400` and `area400-1000`, in square pixels.
    """
    return AttributeTerm(name=name, title=_TITLES.get(name) or _size_title(name))


def _size_title(name: str) -> str:
    match = _SIZE_BIN.fullmatch(name)
    if match is None:
        return ""
    if match["low"]:
        return f"first box of {match['low']} to {match['high']} px²"
    return f"first box {'below' if match['sign'] == '<' else 'above'} {match['limit']} px²"
