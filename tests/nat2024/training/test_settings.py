"""Settings from texts, and those that cannot be."""

import pytest

from nat2024.errors import InvalidOption
from nat2024.training import set_values


def test_settings_are_read_from_texts(settings):
    base = settings()
    changed = set_values([base], {"betas": "0.8,0.9", "steps": "7", "mixed_precision": "true"})
    assert (changed[0].betas, changed[0].steps, changed[0].mixed_precision) == ((0.8, 0.9), 7, True)
    assert base.steps == 24
    with pytest.raises(InvalidOption, match="no setting 'learning_rat'; closest: learning_rate"):
        set_values([base], {"learning_rat": 1})
    with pytest.raises(InvalidOption, match="training setting steps=0: expected `int` >= 1"):
        set_values([base], {"steps": "0"})
    with pytest.raises(InvalidOption, match="schedule=step: invalid enum value 'step'"):
        set_values([base], {"schedule": "step"})


def test_mixed_precision_is_for_cuda(tmp_path, run, settings):
    with pytest.raises(InvalidOption, match="for CUDA, not cpu"):
        run(tmp_path, settings(mixed_precision=True))
