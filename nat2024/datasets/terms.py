"""What the abbreviations of attributes mean, in the words of the papers that publish them."""

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


def attribute_term(name: str) -> AttributeTerm:
    """An attribute with its title, empty where the abbreviation is not known."""
    return AttributeTerm(name=name, title=_TITLES.get(name, ""))
