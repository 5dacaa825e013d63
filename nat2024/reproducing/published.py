"""Numbers as papers print them, one declaration a table.

LDEnhancer: Yao et al., "Enhancing Nighttime UAV Tracking with Light Distribution Suppression", IROS
2024, Tables IV and V: SiamRPN++ (AlexNet) on UAVDark135 in one-pass evaluation. Gains are percent
of the tracker alone, made from the printed scores.
"""

from dataclasses import dataclass
from typing import Final

_NO_FILES = "no result files are published"
_ABLATION = "no result files of this variant are published"


@dataclass(frozen=True, slots=True)
class PublishedRow:
    """One row of a published table.

    Attributes:
        method: as the paper names it.
        success: area under the success curve.
        precision: precision at 20 px.
        success_gain: percent, NaN for the row of the tracker alone.
        precision_gain: percent, likewise.
        enhancer: name of the enhancer in nat-bench, "none" for the tracker alone; empty where no
            run can be the row.
        files: where result files of the row are, or why there are none.
    """

    method: str
    success: float
    precision: float
    success_gain: float
    precision_gain: float
    enhancer: str
    files: str


@dataclass(frozen=True, slots=True)
class PublishedTable:
    """A published table.

    Attributes:
        name: its number and subject.
        rows: in the paper's order.
    """

    name: str
    rows: tuple[PublishedRow, ...]


@dataclass(frozen=True, slots=True)
class Publication:
    """What a paper prints about one tracker on one dataset.

    Attributes:
        title: of the paper.
        source: authors, venue and year.
        dataset: registered name.
        tracker: name in nat-bench.
        protocol: the one-pass protocol of the paper's code.
        results: where its authors publish result files.
        tables: what is compared.
    """

    title: str
    source: str
    dataset: str
    tracker: str
    protocol: str
    results: str
    tables: tuple[PublishedTable, ...]


_NAN = float("nan")
_OTHERS = "results/others of vision4robotics/LDEnhancer"
_OWN = "results/UAVDark135 of vision4robotics/LDEnhancer"
_SCT = "results/AgainstOtherEn of vision4robotics/SCT"

_PLAIN: Final = PublishedRow("SiamRPN++", 0.372, 0.474, _NAN, _NAN, "none", _OTHERS)

_TABLE_IV: Final = PublishedTable(
    "Table IV, enhancers",
    (
        _PLAIN,
        PublishedRow("RUAS", 0.381, 0.490, 2.419, 3.376, "ruas", _OTHERS),
        PublishedRow("KinD++", 0.386, 0.485, 3.763, 2.321, "kindpp", _NO_FILES),
        PublishedRow("LIME", 0.393, 0.501, 5.645, 5.696, "lime", _OTHERS),
        PublishedRow("EnlightenGAN", 0.397, 0.505, 6.720, 6.540, "enlightengan", _OTHERS),
        PublishedRow("LLVE", 0.397, 0.508, 6.720, 7.173, "llve", _OTHERS),
        PublishedRow("DCE++", 0.402, 0.512, 8.065, 8.017, "dcepp", _OTHERS),
        PublishedRow("DarkLighter", 0.385, 0.495, 3.495, 4.430, "darklighter", _OTHERS),
        PublishedRow("HighlightNet", 0.376, 0.483, 1.075, 1.899, "highlightnet", _NO_FILES),
        PublishedRow("SCT", 0.421, 0.547, 13.172, 15.401, "sct", _SCT),
        PublishedRow("LDEnhancer", 0.434, 0.560, 16.667, 18.143, "ldenhancer", _OWN),
    ),
)

_TABLE_V: Final = PublishedTable(
    "Table V, ablation",
    (
        PublishedRow("Baseline", 0.395, 0.510, 6.183, 7.595, "", _ABLATION),
        PublishedRow("Baseline+TB", 0.408, 0.529, 9.677, 11.603, "", _ABLATION),
        PublishedRow("Baseline+TB+LS", 0.421, 0.541, 13.172, 14.135, "", _ABLATION),
        PublishedRow("Baseline+TB+LS+TF", 0.434, 0.560, 16.667, 18.143, "ldenhancer", _OWN),
    ),
)

PUBLICATIONS: Final[dict[str, Publication]] = {
    "ldenhancer": Publication(
        title="Enhancing Nighttime UAV Tracking with Light Distribution Suppression",
        source="Yao et al., IROS 2024, Tables IV and V",
        dataset="uavdark135",
        tracker="siamrpnpp",
        protocol="pysot",
        results="https://github.com/vision4robotics/LDEnhancer",
        tables=(_TABLE_IV, _TABLE_V),
    )
}
"""By the name that `nat-bench reproduce` takes."""
