"""What runs did on the frames of a dataset: losses, light, over-enhancement, thumbnails.

Reports draw what is gathered here and look at no frame themselves. The contract:

```python
evidence = gather(evaluation, dataset, results)   # results: the folder that `run` wrote

evidence.failures()          # DataFrame, one row a run and sequence (columns below)
evidence.light()             # DataFrame, one row a sequence with images
evidence.notes               # lines for people: what could not be gathered, and why
for sequence in evidence.sequences:               # those that any run of the evaluation has
    sequence.name, sequence.length                # length: frames of the sequence
    sequence.light           # analysis.LightTrace of the frames looked at, None without images
    sequence.truth           # float64 (length, 4), NaN where not known
    for run, track in sequence.tracks.items():
        track.frames         # int (n,), 0-based numbers of the scored frames
        track.overlap        # float64 (n,), NaN where the truth is not known
        track.center_error   # float64 (n,), pixels; NaN also where the tracker gave no box
        track.failure        # analysis.Failure (its rows index the arrays above)
        track.first_loss     # 0-based frame number, None where the target is never lost
        track.at_loss        # LossEvidence or None
    for thumbnail in sequence.thumbnails:         # at most 5, in the order of frames
        thumbnail.frame      # 0-based
        thumbnail.reasons    # of "best", "worst", "largest gain", "largest harm", "first loss"
        thumbnail.run        # the run that gain, harm or loss is about; may be empty
        thumbnail.jpeg       # bytes, 5 to 15 KB, 320 px wide
        thumbnail.width, thumbnail.height         # pixels
        thumbnail.truth      # (x, y, w, h) in pixels of the thumbnail, None where not known
        thumbnail.boxes      # by run, likewise; a box may lie outside of the picture
```

Columns of `failures()`: `run`, `tracker`, `enhancer`, `sequence`, `frames` (that count), `absent`
(that do not), `first_loss` (0-based frame number, NA if never lost), `losses`, `lost` (frames),
`recoveries`, `drift` (pixels a frame before the first loss), `longest` (frames without a loss),
`luminance_at_loss` (mean grey around the target, 0..1), `unevenness_at_loss` (stops),
`over_enhancement_at_loss` (0..1, share of the way to white; NaN without an enhancer, where nothing
was bright, or where the enhancer cannot be made again).

Columns of `light()`: `sequence`, `frames` (looked at), `luminance` (mean grey of the frame, 0..1),
`unevenness` (stops, over the frame), `target_luminance` (0..1), `target_unevenness` (stops); each
the median over the frames looked at. `gains_and_light` puts them beside gains.

Overlaps and errors are plain geometry, whatever the protocol of the scores: the truth must be four
finite numbers with w, h > 0 and must not be flagged invisible, else NaN; a missing or unusable box
of the tracker overlaps nothing (0).

What takes long, looking at frames, is kept in `RESULTS/DATASET/.evidence/`, each number under a
digest of all that it was made from (frame file, truth, boxes, options and weights of the enhancer,
version of the computation). So it is never stale, and may be deleted at any time.
"""

from nat2024.evidence.enhancers import make_again
from nat2024.evidence.explaining import (
    LIGHT_MEASURES,
    correlate_gains,
    gains_and_light,
    mean_gains,
)
from nat2024.evidence.gathering import gather, telling_frames
from nat2024.evidence.records import (
    Evidence,
    LossEvidence,
    SequenceEvidence,
    Thumbnail,
    TrackEvidence,
)

__all__ = [
    "LIGHT_MEASURES",
    "Evidence",
    "LossEvidence",
    "SequenceEvidence",
    "Thumbnail",
    "TrackEvidence",
    "correlate_gains",
    "gains_and_light",
    "gather",
    "make_again",
    "mean_gains",
    "telling_frames",
]
