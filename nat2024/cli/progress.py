"""How far a long job has come."""


class ProgressBar:
    """A bar on standard error where that is a terminal, nothing elsewhere."""

    def __init__(self, total: int, unit: str = "frame") -> None:
        from tqdm import tqdm

        self._bar = tqdm(total=total, unit=unit, disable=None, dynamic_ncols=True)

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def __call__(self, done: int, what: str) -> None:
        """Tell how many were done since the last call, and what is being worked on."""
        self._bar.set_description(what, refresh=False)
        self._bar.update(done)
