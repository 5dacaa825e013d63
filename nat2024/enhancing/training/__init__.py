"""Training enhancers: pictures, batches, validation and the ablation around `nat2024.training`."""

from nat2024.enhancing.training.ablation import (
    Spread,
    Variant,
    run_ablation,
    spread,
    tracking_script,
)
from nat2024.enhancing.training.running import (
    EnhancerTraining,
    EnhancerTrainingReport,
    choose_settings,
    list_presets,
    train_enhancer,
)
from nat2024.enhancing.training.settings import PictureSettings
from nat2024.enhancing.training.validation import Tracking

__all__ = [
    "EnhancerTraining",
    "EnhancerTrainingReport",
    "PictureSettings",
    "Spread",
    "Tracking",
    "Variant",
    "choose_settings",
    "list_presets",
    "run_ablation",
    "spread",
    "tracking_script",
    "train_enhancer",
]
