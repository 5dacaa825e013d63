"""One-pass evaluation of boxes: pure functions over arrays, and the protocols of the field.

Conventions: boxes are float64 (n, 4) of x, y, w, h in pixels, one row a frame; scores are in
0..1; inputs are never written to; nothing here reads files or prints.

* overlap: intersection over union, per frame (`overlap`);
* centre error: distance of the centres in pixels (`center_error`);
* normalised centre error: x divided by the true width, y by the true height
  (`normalized_center_error`; Muller et al., TrackingNet, ECCV 2018);
* success: share of frames with an overlap above 0, 0.05, ..., 1 and its area (`success_curve`;
  Wu et al., OTB, CVPR 2013);
* precision: share of frames with a centre error of at most 0, 1, ..., 50 px, read at 20 px
  (`precision_curve`; Wu et al., OTB, CVPR 2013);
* normalised precision: the same for 0, 0.01, ..., 0.5, read at 0.20
  (`normalized_precision_curve`; Muller et al., TrackingNet, ECCV 2018);
* average overlap and success rates (Huang et al., GOT-10k, TPAMI 2021).

Under the strict comparison that most toolkits share, a perfect tracker fails at threshold 1 and
scores 20/21 = 0.952 in success; only `trackingnet` and `strict` give it 1.

`evaluate_boxes` scores one sequence under a named `Protocol`, `summarize` averages many,
`paired_bootstrap` tells whether one result is better than another on the same sequences.
"""

from nat2024.metrics.bootstrap import FEWEST_SEQUENCES, PairedGains, paired_bootstrap
from nat2024.metrics.curves import (
    NORMALIZED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS,
    SUCCESS_THRESHOLDS,
    normalized_precision_curve,
    precision_curve,
    success_curve,
)
from nat2024.metrics.datasets import DatasetScores, sequence_weights, summarize
from nat2024.metrics.geometry import center_error, normalized_center_error, overlap
from nat2024.metrics.protocols import (
    LENGTH_RULES,
    LengthRule,
    Protocol,
    get_protocol,
    list_protocols,
)
from nat2024.metrics.repeats import average_repeats
from nat2024.metrics.scores import SCORE_NAMES, FrameValues, Scores, SequenceScores
from nat2024.metrics.sequences import evaluate_boxes

__all__ = [
    "FEWEST_SEQUENCES",
    "LENGTH_RULES",
    "NORMALIZED_PRECISION_THRESHOLDS",
    "PRECISION_THRESHOLDS",
    "SCORE_NAMES",
    "SUCCESS_THRESHOLDS",
    "DatasetScores",
    "FrameValues",
    "LengthRule",
    "PairedGains",
    "Protocol",
    "Scores",
    "SequenceScores",
    "average_repeats",
    "center_error",
    "evaluate_boxes",
    "get_protocol",
    "list_protocols",
    "normalized_center_error",
    "normalized_precision_curve",
    "overlap",
    "paired_bootstrap",
    "precision_curve",
    "sequence_weights",
    "success_curve",
    "summarize",
]
