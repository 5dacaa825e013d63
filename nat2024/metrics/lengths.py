"""Results and ground truths of unequal length."""

import numpy as np

from nat2024.errors import LengthMismatch
from nat2024.metrics.protocols import LengthRule, Protocol
from nat2024.types import Boxes


def align(
    predicted: Boxes, truth: Boxes, protocol: Protocol, on_length: LengthRule | None
) -> tuple[Boxes, int, int]:
    """Bring a result to the length of what is scored.

    Returns:
        The result of `rows` rows, `rows`, and how many of them were there before filling in.
        With "pad" the missing rows are NaN, which fails; rows beyond the ground truth are cut.

    Raises:
        LengthMismatch: the lengths differ and the rule refuses that, or nothing is left.
    """
    given, wanted = len(predicted), len(truth)
    if given == wanted:
        return predicted, wanted, wanted
    rule, filler = (on_length, np.nan) if on_length else _rule_of(protocol, given < wanted)
    if rule == "error":
        raise LengthMismatch(_refusal(given, wanted, protocol))
    if rule == "cut" or given > wanted:
        rows = min(given, wanted)
        if rows == 0:
            msg = f"result has {given} rows, ground truth {wanted}: nothing to score after cutting"
            raise LengthMismatch(msg)
        return predicted[:rows], rows, rows
    missing = np.full((wanted - given, 4), filler)
    return np.concatenate([predicted, missing]), wanted, given


def _rule_of(protocol: Protocol, is_short: bool) -> tuple[LengthRule, float]:
    """What the protocol's own toolkit does, and what it fills missing rows with."""
    if protocol.name == "got10k-ope":
        return "cut", np.nan
    if protocol.name == "trackingnet":
        return "pad", np.nan
    if protocol.name == "pytracking":
        return ("error" if is_short and protocol.label == "lasot" else "pad"), 0.0
    if protocol.name == "lasot" and not is_short:
        return "cut", np.nan
    return "error", np.nan


def _refusal(given: int, wanted: int, protocol: Protocol) -> str:
    hint = 'compare the files, or pass on_length="pad" (missing rows fail) or "cut" (--on-length)'
    if given == wanted - 1:
        hint = (
            "one row short: the tracker probably wrote none for the first frame; "
            "put the initial box in as row 1, so that rows and frames agree"
        )
    return f"result has {given} rows, ground truth {wanted}; protocol {protocol.name}: {hint}"
