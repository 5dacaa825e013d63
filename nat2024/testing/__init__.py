"""Conformance suites: what every plugin must keep, for our own plugins and for others'."""

from nat2024.testing.enhancers import check_enhancer
from nat2024.testing.trackers import check_tracker

__all__ = ["check_enhancer", "check_tracker"]
