"""Where the folder of a registered dataset lies.

Taken in this order: the `root` argument, the environment variable NAT2024_ROOT_<DATASET>, the
table `[roots]` of the configuration file, NAT2024_ROOT/<folder>, the key `root` of the
configuration file followed by <folder>. The configuration file is named by NAT2024_CONFIG, else it
is `config.toml` in the user's configuration folder:

    root = "/data"

    [roots]
    uavdark135 = "/data/night/UAVDark135"
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import msgspec

from nat2024.archives import is_archive
from nat2024.datasets.listings import path_kind
from nat2024.datasets.registered import (
    DatasetFacts,
    is_registered,
    list_datasets,
    registered_dataset,
)
from nat2024.errors import DatasetNotFound, UsageError
from nat2024.types import closest


class Configuration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The configuration file.

    Attributes:
        root: a folder that holds the folders of several datasets; empty where not set.
        roots: folder of a dataset by its registered name.
    """

    root: str = ""
    roots: dict[str, str] = msgspec.field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ConfiguredRoot:
    """One place that is configured for datasets.

    Attributes:
        dataset: registered name, or an empty text for a folder of several datasets.
        path: the folder, which may not exist.
        origin: which variable or file says so.
    """

    dataset: str
    path: Path
    origin: str


def configuration_path() -> Path:
    """The configuration file: NAT2024_CONFIG, else `config.toml` in the user's folder."""
    given = os.environ.get("NAT2024_CONFIG")
    if given:
        return Path(given).expanduser()
    import platformdirs

    return platformdirs.user_config_path("nat-bench") / "config.toml"


def read_configuration() -> Configuration:
    """Read the configuration file; an empty configuration where there is none.

    Raises:
        UsageError: NAT2024_CONFIG names no file, or the file is no TOML, has unknown keys, values
            of a wrong type or unknown datasets; names file and key.
    """
    path = configuration_path()
    try:
        configuration = msgspec.toml.decode(path.read_bytes(), type=Configuration)
    except FileNotFoundError:
        if os.environ.get("NAT2024_CONFIG"):
            msg = f"NAT2024_CONFIG={path}: no such file"
            raise UsageError(msg) from None
        return Configuration()
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise UsageError(msg) from None
    except (ValueError, RecursionError) as error:  # of no UTF-8 and endless nesting too
        msg = f"{path}: {error}"
        raise UsageError(msg) from None
    for name in configuration.roots:
        if not is_registered(name):
            msg = f"{path}: [roots] {name}: no such dataset{closest(name, list_datasets())}"
            raise UsageError(msg)
    return configuration


def configured_roots() -> tuple[ConfiguredRoot, ...]:
    """All places that environment and configuration file name, the stronger ones first."""
    configuration, file = read_configuration(), configuration_path()
    found = []
    for name in list_datasets():
        variable = root_variable(name)
        if os.environ.get(variable):
            found.append(ConfiguredRoot(name, _path(os.environ[variable]), variable))
    for name, text in sorted(configuration.roots.items()):
        found.append(ConfiguredRoot(name, file.parent / _path(text), f"{file} [roots]"))
    if os.environ.get("NAT2024_ROOT"):
        found.append(ConfiguredRoot("", _path(os.environ["NAT2024_ROOT"]), "NAT2024_ROOT"))
    if configuration.root:
        found.append(ConfiguredRoot("", file.parent / _path(configuration.root), f"{file} root"))
    return tuple(found)


def root_variable(name: str) -> str:
    """The environment variable with the folder of a dataset, such as NAT2024_ROOT_UAVDARK135."""
    return f"NAT2024_ROOT_{name.upper()}"


def find_root(name: str, root: str | os.PathLike[str] | None = None) -> Path:
    """The folder of a registered dataset.

    Args:
        name: registered name.
        root: the dataset's own folder, or a folder that holds it.

    Raises:
        DatasetNotFound: nothing is configured and it is no bundled sample, or the folder is not
            there; says what was tried and where a person gets the dataset.
        UsageError: the configuration file is wrong.
    """
    facts = registered_dataset(name)
    if root is not None:
        return _own_folder(name, facts, ConfiguredRoot(name, _path(root), "root"))
    places = configured_roots()
    for place in places:
        if place.dataset == name:
            return _own_folder(name, facts, place)
    shared = [place for place in places if not place.dataset]
    for place in shared:
        folder = _sub_folder(place.path, facts.folders)
        if folder is not None:
            return folder
    bundled = bundled_archive(name)
    if bundled is not None:
        return bundled
    tried = [f"{root_variable(name)} is not set", f"no [roots] entry in {configuration_path()}"]
    tried += [f"{_first_folder(place.path, facts)} ({place.origin}) is absent" for place in shared]
    tried += [] if shared else ["NAT2024_ROOT is not set"]
    raise DatasetNotFound(_not_found(name, tried))


def bundled_archive(name: str) -> Path | None:
    """The archive of a sample that comes with the package; None for all other datasets."""
    resource = files("nat2024.datasets").joinpath("samples", f"{name}.zip")
    path = Path(str(resource))
    return path if path.is_file() else None


def _own_folder(name: str, facts: DatasetFacts, place: ConfiguredRoot) -> Path:
    """What a user named for this dataset: a folder, one that holds it, or a .zip archive of it."""
    if is_archive(place.path):
        return place.path
    kind = path_kind(place.path)
    if kind != "folder":
        what = "is a file" if kind == "file" else "is absent"
        raise DatasetNotFound(_not_found(name, [f"{place.path} ({place.origin}) {what}"]))
    return _sub_folder(place.path, facts.folders) or place.path


def _sub_folder(path: Path, names: tuple[str, ...]) -> Path | None:
    """The first sub-folder of one of these names, in any case."""
    try:
        found: Mapping[str, Path] = {p.name.lower(): p for p in sorted(path.iterdir())}
    except OSError:
        return None
    candidates = (found.get(name.lower()) for name in names)
    return next((p for p in candidates if p and p.is_dir()), None)


def _first_folder(path: Path, facts: DatasetFacts) -> Path:
    return path / facts.folders[0] if facts.folders else path


def _not_found(name: str, tried: list[str]) -> str:
    return f"dataset {name} not found: {'; '.join(tried)}. {how_to_get(name)}"


def how_to_get(name: str) -> str:
    """One line: where a person gets a registered dataset and what its folder must look like."""
    facts = registered_dataset(name)
    where = f"{facts.title} is to be had by hand: {facts.obtain}; " if facts.obtain else ""
    look = f"its folder must hold {facts.expected_layout}; " if facts.expected_layout else ""
    return f"{where}{look}then pass its folder as root or set {root_variable(name)}"


def _path(text: str | os.PathLike[str]) -> Path:
    return Path(text).expanduser()
