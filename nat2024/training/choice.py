"""Which step's weights come out, and when a training has lost patience."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from nat2024.errors import InvalidOption
from nat2024.training.settings import TrainingSettings
from nat2024.types import closest


class BestStep:
    """The step whose validation was best by `settings.best`.

    Attributes:
        step: that step, None where none was chosen yet.
        unchanged: validations since then.
    """

    def __init__(self, settings: TrainingSettings, validate: object | None) -> None:
        """Begin without a step.

        Args:
            settings: `best` and `patience`.
            validate: the validation; None where there is none.

        Raises:
            InvalidOption: nothing can be chosen by, as there is no validation, no such number
                (where the validation tells its `names`), or patience without a number.
        """
        self.settings = settings
        self.name = settings.best.removeprefix("-")
        self.step: int | None = None
        self.unchanged = 0
        self._value = math.nan
        if settings.patience and not self.name:
            msg = f"training setting patience={settings.patience} needs best, the number of the "
            msg += "validation that is to get better"
            raise InvalidOption(msg)
        if self.name and validate is None:
            msg = f"training setting best={settings.best}: there is no validation to choose by"
            raise InvalidOption(msg)
        names = getattr(validate, "names", None)
        if self.name and names is not None:
            self._check_name(names)

    @property
    def has_lost_patience(self) -> bool:
        """Whether so many validations as `patience` brought nothing better."""
        return bool(self.settings.patience) and self.unchanged >= self.settings.patience

    def take(self, step: int, numbers: Mapping[str, float]) -> bool:
        """Look at a validation; whether it is the best so far.

        Raises:
            InvalidOption: it does not have the number.
        """
        self._check_name(numbers)
        value = -numbers[self.name] if self.settings.best.startswith("-") else numbers[self.name]
        if math.isnan(value) or value <= self._value:
            self.unchanged += 1
            return False
        self.step, self._value, self.unchanged = step, value, 0
        return True

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint keeps of it."""
        return {"by": self.settings.best, "best": [self.step, self._value, self.unchanged]}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from a checkpoint; by another number than there, all begins anew."""
        if state["by"] == self.settings.best:
            self.step, self._value, self.unchanged = state["best"]

    def _check_name(self, names: Iterable[str]) -> None:
        known = sorted(names)
        if self.name not in known:
            msg = f"training setting best={self.settings.best}: the validation has no number "
            msg += f"{self.name!r}{closest(self.name, known)}; it has {', '.join(known)}"
            raise InvalidOption(msg)
