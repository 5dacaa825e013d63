"""Typed cards: what a plugin is, whose work it is, and where its weights are to be had."""

from importlib.resources import files
from typing import Literal

import msgspec


class WeightsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One published weights file.

    Attributes:
        name: file name as its authors publish it.
        sha256: digest that tells whether a user's file is this one; empty where not known.
        bytes: size, 0 where not known.
        where: where a person gets it.
        licence: licence of the file; "none stated" forbids shipping it.
        note: which epoch, variant or option it belongs to.
    """

    name: str
    where: str
    licence: str
    sha256: str = ""
    bytes: int = 0
    note: str = ""


class Card(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a person needs to know about a tracker or an enhancer.

    Attributes:
        title: display name, as papers write it.
        summary: one sentence.
        paper: authors, title, venue and year; empty for textbook methods.
        code: the authors' code.
        code_licence: licence of that code ("none stated" where its repository has no file).
        weights: the published weights files.
        needs_weights: whether the plugin runs only with weights.
        parameters: trainable numbers in the network, 0 where it has none.
        macs: multiply-accumulates of convolutions, linear layers and attention products (no
            elementwise work) for one 256x256 image, or for one search crop of a tracker.
        published: results that the authors or the reference paper publish, a line each.
        colour_order: what the network sees from trackers and from images.
        size_rule: how sizes that the network cannot take are handled.
        scopes: enhancement scopes that a tracker can do; for an enhancer the advised ones.
        repeatable: whether the same input gives the same output every time.
        state: what has been proved about this implementation.
        differences: where paper and official code disagree, and what is done here.
    """

    title: str
    summary: str
    paper: str = ""
    code: str = ""
    code_licence: str = ""
    weights: tuple[WeightsFile, ...] = ()
    needs_weights: bool = False
    parameters: int = 0
    macs: int = 0
    published: tuple[str, ...] = ()
    colour_order: str = ""
    size_rule: str = ""
    scopes: tuple[Literal["patch", "frame"], ...] = ("patch", "frame")
    repeatable: bool = True
    state: str = ""
    differences: tuple[str, ...] = ()


def read_card(package: str, name: str = "card.toml") -> Card:
    """Read a card from a file inside `package`."""
    raw = files(package).joinpath(name).read_bytes()
    return msgspec.toml.decode(raw, type=Card)
