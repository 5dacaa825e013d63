"""Papers' numbers beside what their authors' result files give."""

from nat2024.reproducing.comparing import ComparedRow, Reproduction, reproduce
from nat2024.reproducing.published import PUBLICATIONS, Publication, PublishedRow, PublishedTable

__all__ = [
    "PUBLICATIONS",
    "ComparedRow",
    "Publication",
    "PublishedRow",
    "PublishedTable",
    "Reproduction",
    "reproduce",
]
