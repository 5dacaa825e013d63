"""Scores as tables get them: a summary as `Evaluation.summary()`, gains as `Evaluation.gains()`."""

import math
from collections.abc import Callable
from typing import Any

import pandas as pd
import pytest

_COLUMNS = ("run", "tracker", "enhancer", "scope", "success_auc", "precision_20")
_PAPER = {
    # the reference paper's Table IV: success and precision on UAVDark135
    "ruas": (0.381, 0.490),
    "kindpp": (0.386, 0.485),
    "lime": (0.393, 0.501),
    "enlightengan": (0.397, 0.505),
    "llve": (0.397, 0.508),
    "dcepp": (0.402, 0.512),
    "darklighter": (0.385, 0.495),
    "highlightnet": (0.376, 0.483),
    "sct": (0.421, 0.547),
    "ldenhancer": (0.434, 0.560),
}

Rows = list[tuple[Any, ...]]


def make_summary(rows: Rows, **changes: Any) -> pd.DataFrame:
    frame = pd.DataFrame(rows, columns=list(_COLUMNS))
    fixed = {"dataset": "uavdark_135", "protocol": "pysot", "sequences": 135, "frames": 125466}
    missing = {"normalized_precision_20": math.nan, "normalized_precision_auc": math.nan}
    return frame.assign(**{**fixed, **missing, **changes})


@pytest.fixture(scope="session")
def summary() -> Callable[..., pd.DataFrame]:
    """Makes a summary of (run, tracker, enhancer, scope, success, precision)."""
    return make_summary


@pytest.fixture(scope="session")
def paper() -> pd.DataFrame:
    """The scores of the reference paper's Table IV."""
    rows: Rows = [("siamrpnpp", "siamrpnpp", "none", "patch", 0.372, 0.474)]
    rows += [
        (f"siamrpnpp+{name}", "siamrpnpp", name, "patch", *scores)
        for name, scores in _PAPER.items()
    ]
    return make_summary(rows)


def make_gains(rows: Rows, **changes: Any) -> pd.DataFrame:
    columns = ("run", "gain", "gain_low", "gain_high", "certain")
    frame = pd.DataFrame(rows, columns=list(columns))
    fixed = {"metric": "success_auc", "sequences": 135, "improved": 0.6, "base": "a"}
    return frame.assign(**{**fixed, **changes})


@pytest.fixture(scope="session")
def gains() -> Callable[..., pd.DataFrame]:
    """Makes gains of (run, gain, low, high, certain)."""
    return make_gains
