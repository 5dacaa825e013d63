"""Which network a checkpoint is of, by what the cards of all plugins say."""

from collections.abc import Mapping, Set

from nat2024.cards import Card


def recognise(
    entries: Set[str], sha256: str, cards: Mapping[str, Card], *, name: str, variant: str = ""
) -> str:
    """Say what a checkpoint that does not fit is, as the end of a sentence.

    A published file is told by its digest, any other by the telling entries of the cards; where
    several fit, by the most of them.

    Args:
        entries: keys and shapes of the checkpoint, as `zoo.entries_of` gives them.
        sha256: digest of the file, empty where there is none.
        cards: the card of every plugin by its name.
        name: the plugin that the checkpoint does not fit.
        variant: the variant that was asked for, empty for the default one.

    Returns:
        Such as "it looks like a checkpoint of darklighter"; empty where nothing is known, or where
        it is of the very network that was asked for.
    """
    for other, card in cards.items():
        file = card.published_file(sha256)
        if file and other != name:
            return f"it is {file.name} of {other}"
        if file and file.variant and file.variant != (variant or card.variant):
            return f"it is {file.name} of variant {file.variant}: pass variant={file.variant}"
    found = _fitting_networks(entries, cards)
    if not found or (name, variant or _default_variant(cards, name)) in found:
        return ""
    other, other_variant = next((one for one in found if one[0] == name), found[0])
    if other != name:
        of = f" (variant {other_variant})" if other_variant else ""
        return f"it looks like a checkpoint of {other}{of}"
    return f"it looks like one of variant {other_variant}: pass variant={other_variant}"


def _fitting_networks(entries: Set[str], cards: Mapping[str, Card]) -> list[tuple[str, str]]:
    """Names and variants whose telling entries are all there: those that tell the most."""
    found = [
        (len(network.keys), name, network.variant)
        for name, card in cards.items()
        for network in card.networks
        if network.keys and entries >= set(network.keys)
    ]
    most = max((count for count, _, _ in found), default=0)
    return [(name, variant) for count, name, variant in found if count == most]


def _default_variant(cards: Mapping[str, Card], name: str) -> str:
    return cards[name].variant if name in cards else ""
