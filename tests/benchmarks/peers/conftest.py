"""The weights from formulas that the tests of enhancers have."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

import pytest

CONFTEST = Path(__file__).parents[2] / "enhancers" / "conftest.py"


@pytest.fixture(scope="session")
def procedural_state() -> Callable[..., dict]:
    spec = importlib.util.spec_from_file_location("enhancer_conftest", CONFTEST)
    helpers = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(helpers)
    return helpers.make_procedural_state
