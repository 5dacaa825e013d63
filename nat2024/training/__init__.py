"""The training loop: any network, any source of batches, any loss with named terms.

It knows no plugin. `train` runs a training in a folder and goes on there after a kill; `loop` has
the loop, `interfaces` what it is given, `checkpoints` what it keeps, `optimising` the steps,
`choice` the best one, `curves` the numbers.
"""

from nat2024.training.checkpoints import digest_of, write_weights
from nat2024.training.interfaces import Source, TrainingReport
from nat2024.training.loop import train
from nat2024.training.settings import TrainingSettings, choose_preset, set_values

__all__ = [
    "Source",
    "TrainingReport",
    "TrainingSettings",
    "choose_preset",
    "digest_of",
    "set_values",
    "train",
    "write_weights",
]
