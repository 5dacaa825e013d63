"""Options and arguments that several verbs share, and how their texts are read."""

import functools
import logging
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from nat2024.errors import UsageError

if TYPE_CHECKING:
    from nat2024.metrics import Protocol

_Function = TypeVar("_Function", bound=Callable[..., Any])

SAMPLE = "night_mini"
"""The dataset that comes with nat-bench."""

DEFAULT_TRACKER = "fdsst"
"""What runs where no tracker is named: it needs no weights, and repeats itself."""

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
results_option = click.option(
    "--results",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
    help="Folder of results.",
)
stored_results_option = click.option(
    "--results",
    type=click.Path(path_type=Path),
    default=Path("results"),
    show_default=True,
    help="Results of nat-bench, or of another toolkit: a folder or a .zip archive.",
)
dataset_option = click.option(
    "--dataset", metavar="NAME_OR_PATH", help="A registered dataset, or a folder of sequences."
)
root_option = click.option(
    "--root",
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the registered dataset lies; else NAT2024_ROOT_<DATASET> or NAT2024_ROOT.",
)
lenient_option = click.option(
    "--lenient",
    is_flag=True,
    help="Cut sequences whose boxes and frames differ in number to the shorter.",
)
plugin_option = click.option(
    "--plugin",
    "plugins",
    multiple=True,
    metavar="FILE.py",
    help="A Python file (or module) that registers plugins; repeatable.",
)
weights_option = click.option(
    "--weights", multiple=True, metavar="NAME[@LABEL]=PATH", help="A checkpoint; repeatable."
)
opts_option = click.option(
    "--opt", "opts", multiple=True, metavar="NAME[@LABEL].KEY=VALUE", help="An option; repeatable."
)
trackers_option = click.option(
    "--tracker",
    "trackers",
    multiple=True,
    metavar="NAME[@LABEL]",
    help="Repeatable; left out: fdsst, which needs no weights.",
)
enhancers_option = click.option(
    "--enhancer",
    "enhancers",
    multiple=True,
    default=("none",),
    show_default=True,
    metavar="NAME[@LABEL]",
    help="Repeatable; every tracker runs with every enhancer.",
)
scope_option = click.option(
    "--scope",
    type=click.Choice(["patch", "frame"]),
    help="Enhance the tracker's crops or the whole frame; left out, each tracker's own default.",
)
device_option = click.option(
    "--device", default="auto", show_default=True, help="cpu, cuda, cuda:N; auto takes CUDA if any."
)
precision_option = click.option(
    "--precision",
    type=click.Choice(["float32", "bfloat16"]),
    default="float32",
    show_default=True,
    help="What the backend computes in.",
)
protocol_option = click.option(
    "--protocol", default="pysot", show_default=True, help="Evaluation protocol."
)
protocol_options_option = click.option(
    "--protocol-option",
    "protocol_options",
    multiple=True,
    metavar="KEY=VALUE",
    help="Option of the protocol, such as label=uav; repeatable.",
)
computed_attributes_option = click.option(
    "--computed-attributes",
    is_flag=True,
    help="Attributes computed from boxes and from every 10th frame, beside published ones.",
)
only_trackers_option = click.option(
    "--trackers", multiple=True, metavar="A,B", help="Only these, as NAME[@LABEL]."
)
only_enhancers_option = click.option(
    "--enhancers", multiple=True, metavar="A,B", help="Only these, beside the trackers alone."
)
table_format_option = click.option(
    "--format",
    "form",
    type=click.Choice(["console", "markdown", "csv", "latex", "html"]),
    default="console",
    show_default=True,
)
on_length_option = click.option(
    "--on-length",
    type=click.Choice(["error", "pad", "cut"]),
    help="Results and truth of unequal length; left out, the protocol decides.",
)
cache_option = click.option(
    "--cache/--no-cache",
    default=True,
    help="Take scores that were kept before where nothing has changed, and keep new ones.",
)


def backend_option(default: str) -> Callable[[_Function], _Function]:
    """`--backend`, with a default of the verb's own."""
    return click.option(
        "--backend",
        type=click.Choice(["auto", "torch", "onnxruntime", "openvino", "tensorrt"]),
        default=default,
        show_default=True,
        help="What runs networks; auto: the fastest one installed that gives torch's numbers.",
    )


def messages(function: _Function) -> _Function:
    """Add `--quiet` and `--debug`, and send the library's log to standard error."""

    @click.option("--quiet", "-q", is_flag=True, help="Only results and errors.")
    @click.option("--debug", is_flag=True, help="Show the traceback of an error.")
    @functools.wraps(function)
    def wrapped(*args: Any, quiet: bool, debug: bool, **kwargs: Any) -> Any:
        level = logging.DEBUG if debug else logging.ERROR if quiet else logging.INFO
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(logging.Formatter("nat-bench: %(message)s"))
        logger = logging.getLogger("nat2024")
        logger.addHandler(handler)
        logger.setLevel(level)
        try:
            return function(*args, **kwargs)
        finally:
            logger.removeHandler(handler)

    return wrapped  # type: ignore[return-value]


def read_names(texts: Iterable[str]) -> tuple[str, ...]:
    """Names of `A,B` texts, each once."""
    parts = (part.strip() for text in texts for part in text.split(","))
    return tuple(dict.fromkeys(part for part in parts if part))


def read_size(text: str) -> tuple[int, int]:
    """Width and height of `WxH`."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        msg = f"--size {text!r}: expected WxH, such as 640x360"
        raise UsageError(msg)
    return int(width), int(height)


def load_plugins(sources: Iterable[str]) -> None:
    """Load plugin files in the order given."""
    from nat2024.registry import load_plugin_file

    for source in sources:
        load_plugin_file(source)


def read_pairs(texts: Iterable[str], option: str) -> dict[str, str]:
    """Read `KEY=VALUE` texts.

    Raises:
        UsageError: one has no `=`, or a key comes twice.
    """
    pairs: dict[str, str] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not (key and sign):
            msg = f"{option} {text!r}: expected KEY=VALUE"
            raise UsageError(msg)
        if key in pairs:
            msg = f"{option} {key} is given twice"
            raise UsageError(msg)
        pairs[key] = value
    return pairs


def read_plugin_options(texts: Iterable[str]) -> dict[str, dict[str, str]]:
    """Read `NAME[@LABEL].KEY=VALUE` texts into options by `NAME[@LABEL]`.

    Raises:
        UsageError: one is not of this form.
    """
    options: dict[str, dict[str, str]] = {}
    for key, value in read_pairs(texts, "--opt").items():
        plugin, dot, name = key.rpartition(".")
        if not (plugin and dot and name):
            msg = f"--opt {key}={value}: expected NAME[@LABEL].KEY=VALUE"
            raise UsageError(msg)
        options.setdefault(plugin, {})[name] = value
    return options


def choose_dataset(dataset: str | None) -> str:
    """The dataset of `--dataset`; where none is named the bundled sample, which is said."""
    if dataset is not None:
        return dataset
    logging.getLogger("nat2024").info("no --dataset given, taking the sample %s", SAMPLE)
    return SAMPLE


def choose_trackers(trackers: tuple[str, ...]) -> tuple[str, ...]:
    """The trackers of `--tracker`; where none is named the default one, which is said."""
    if trackers:
        return trackers
    logging.getLogger("nat2024").info("no --tracker given, taking %s", DEFAULT_TRACKER)
    return (DEFAULT_TRACKER,)


def choose_device(device: str) -> str:
    """The device of `--device`: "auto" is CUDA where there is any."""
    if device != "auto":
        return device
    import torch

    return "cuda" if torch.cuda.is_available() else "cpu"


def choose_protocol(name: str, texts: Iterable[str]) -> "Protocol":
    """The protocol of `--protocol` and `--protocol-option`.

    Raises:
        UsageError: no such protocol or option, or a value of the wrong type.
    """
    import dataclasses

    import msgspec

    from nat2024.metrics import Protocol
    from nat2024.types import closest

    given = read_pairs(texts, "--protocol-option")
    # frame size and cover belong to one sequence, so no text for a whole dataset can give them
    of_sequences = ("name", "frame_size", "cover")
    known = [field.name for field in dataclasses.fields(Protocol) if field.name not in of_sequences]
    for key in given:
        if key not in known:
            msg = f"protocols have no option {key!r}{closest(key, known)}"
            raise UsageError(msg)
    try:
        return msgspec.convert({"name": name, **given}, Protocol, strict=False)
    except msgspec.ValidationError as error:
        msg = f"--protocol-option: {error}"
        raise UsageError(msg) from None
