"""What all tests of the command line share."""

from typing import Any

import pytest

from nat2024.cli import run


@pytest.fixture
def cli(capsys: Any) -> Any:
    """Run a command; gives (exit status, standard output, standard error)."""

    def call(*words: object) -> tuple[int, str, str]:
        status = run([str(word) for word in words])
        out, err = capsys.readouterr()
        return status, out, err

    return call
