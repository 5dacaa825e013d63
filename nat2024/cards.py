"""Typed cards: what a plugin is, whose work it is, and where its weights are to be had."""

import re
from collections.abc import Mapping
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
        note: which epoch, variant or option it belongs to; where it begins with `variant NAME`,
            the file belongs to that variant only.
        bundled: where the file lies if it comes with a package, as `PACKAGE/FILE`, such as
            `my_package.net/bundled/small.safetensors`.
        preset: the value of the plugin's option `preset` that takes it, where several files come
            with a package.
    """

    name: str
    where: str
    licence: str
    sha256: str = ""
    bytes: int = 0
    note: str = ""
    bundled: str = ""
    preset: str = ""

    @property
    def variant(self) -> str:
        """The only variant that the file belongs to; empty where its note names none."""
        match = re.match(r"variant ([A-Za-z0-9_]+)", self.note)
        return match[1] if match else ""


class NetworkFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One network of a plugin; a plugin with variants may have several.

    Attributes:
        variant: the value of the option `variant` that builds it; empty where there are none.
        parameters, macs, template_macs, keys: as in `Card`.
    """

    variant: str = ""
    parameters: int = 0
    macs: int = 0
    template_macs: int = 0
    keys: tuple[str, ...] = ()


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
            elementwise work) for one 256x256 image; of a tracker for one search crop through
            backbone, neck and the whole head, as the authors' code computes it in every frame.
        macs_options: the options that `macs` are counted with, where the default ones leave a part
            of the network out.
        template_macs: the same for the template crop of a tracker through backbone and neck.
        keys: a few entries of its state dict, as `KEY (SHAPE)`, that together tell a checkpoint of
            this network from those of all others.
        variant: the variant that `parameters`, `macs`, `template_macs` and `keys` are of; empty
            where there are no variants, or where all share one network.
        variants: the networks of the other variants.
        published: results that the authors or the reference paper publish, a line each.
        colour_order: what the network sees from trackers and from images.
        size_rule: how sizes that the network cannot take are handled.
        scopes: enhancement scopes that a tracker can do; for an enhancer the advised ones.
        repeatable: whether the same input gives the same output every time.
        state: what has been proved about this implementation.
        training: what a training of it here takes, or why there is none.
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
    macs_options: dict[str, bool | int | float | str] = {}
    template_macs: int = 0
    keys: tuple[str, ...] = ()
    variant: str = ""
    variants: tuple[NetworkFacts, ...] = ()
    published: tuple[str, ...] = ()
    colour_order: str = ""
    size_rule: str = ""
    scopes: tuple[Literal["patch", "frame"], ...] = ("patch", "frame")
    repeatable: bool = True
    state: str = ""
    training: str = ""
    differences: tuple[str, ...] = ()

    @property
    def networks(self) -> tuple[NetworkFacts, ...]:
        """All networks, that of `variant` first; none for methods without a network."""
        default = NetworkFacts(
            self.variant, self.parameters, self.macs, self.template_macs, self.keys
        )
        return (default, *self.variants) if self.parameters or self.keys else ()

    def published_file(self, sha256: str) -> WeightsFile | None:
        """The published weights file that has this digest."""
        return next((f for f in self.weights if f.sha256 and f.sha256 == sha256), None)


def read_card(package: str, name: str = "card.toml") -> Card:
    """Read a card from a file inside `package`."""
    raw = files(package).joinpath(name).read_bytes()
    return msgspec.toml.decode(raw, type=Card)


def describe_card(card: Card) -> dict[str, tuple[str, ...]]:
    """What a card says, as lines of text under their headings; empty headings are left out."""
    found = {
        "Paper": (card.paper,),
        "Authors' code": (card.code,),
        "Licence of the code": (card.code_licence,),
        "Network": tuple(
            _describe_network(network, card.macs_options) for network in card.networks
        ),
        "Weights": tuple(_describe_file(file) for file in card.weights),
        "Colour order": (card.colour_order,),
        "Sizes": (card.size_rule,),
        "Default scope": (card.scopes[0],) if card.scopes else (),
        "Repeatable": () if card.repeatable else ("no",),
        "State": (card.state,),
        "Training": (card.training,),
        "Published": card.published,
        "Paper, official code, and this one": card.differences,
    }
    return {heading: lines for heading, lines in found.items() if any(lines)}


def short_count(count: int) -> str:
    """A large number in three to four digits, such as 33.52 k or 1.723 G; empty for 0."""
    if not count:
        return ""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if count >= size:
            return f"{count / size:.4g} {letter}"
    return str(count)


def _describe_network(network: NetworkFacts, options: Mapping[str, object]) -> str:
    if not network.parameters:
        return ""
    variant = f"variant {network.variant}: " if network.variant else ""
    text = f"{variant}{network.parameters:,} parameters"
    if network.template_macs:
        text += (
            f", {short_count(network.macs)} multiply-accumulates a search crop, "
            f"{short_count(network.template_macs)} the template"
        )
    elif network.macs:
        text += f", {short_count(network.macs)} multiply-accumulates for a 256x256 image"
        if options:
            text += f" ({', '.join(f'{key}={value}' for key, value in options.items())})"
    return text


def _describe_file(file: WeightsFile) -> str:
    text = f"{file.name} ({file.note})" if file.note else file.name
    text += f", {file.where}; licence: {file.licence}"
    return f"{text}; sha256 {file.sha256}" if file.sha256 else text
