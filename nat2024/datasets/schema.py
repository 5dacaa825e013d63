"""The annotation schema `nat-bench/1`: one JSON document that says all about a tracking dataset.

It is what an index file (`nat-bench.json`) holds. Numbers are kept to the last bit: float64 is
written as the shortest text that reads back equal, NaN as `null`, infinite values as `"inf"` and
`"-inf"`. Fields that are left out have their default; unknown fields are refused.
"""

import inspect
import re
import textwrap
from pathlib import Path
from typing import Any, Literal, TypeAlias

import msgspec

from nat2024 import archives
from nat2024.datasets.file_names import expand_pattern
from nat2024.errors import AnnotationInvalid

VERSION = "nat-bench/1"
INDEX_FILE = "nat-bench.json"

Provenance: TypeAlias = Literal["published", "computed", "manual"]
Coordinate: TypeAlias = float | Literal["inf", "-inf"] | None
Row: TypeAlias = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
Flag: TypeAlias = Literal[0, 1]

_ENTRY = re.compile(r"^(\w+): (.+(?:\n {4}.+)*)", re.MULTILINE)


class FrameFiles(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The image files of one sequence, all in one folder, or its video.

    Either `names` lists the images, or `pattern` with `first` and `count` does, or `video` names
    one file that holds all frames.

    Attributes:
        folder: path from the index file's folder, parts separated by `/`; empty for that folder
            itself. Never absolute, never with `..`.
        count: number of frames.
        pattern: file names such as `%06d.jpg`: one `%d` or `%0Nd` that becomes the number.
        first: number of the first file.
        names: file names in frame order, where no pattern fits them.
        video: file name of a video that holds the frames.
        sizes: bytes of each file (of a video: of that one); empty where not recorded.
        sha256: checksum of each file as 64 hexadecimal digits; empty where not recorded.
    """

    folder: str
    count: int
    pattern: str = ""
    first: int = 1
    names: tuple[str, ...] = ()
    video: str = ""
    sizes: tuple[int, ...] = ()
    sha256: tuple[str, ...] = ()

    def files(self) -> tuple[str, ...]:
        """Names of the files that hold the frames: images in frame order, or one video."""
        if self.video:
            return (self.video,)
        if self.names or not self.pattern:
            return self.names
        return expand_pattern(self.pattern, self.first, self.count)


class AttributeTerm(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What an abbreviation means.

    Attributes:
        name: abbreviation, such as `FM`.
        title: in words, such as `fast motion`.
        definition: when a sequence has it.
    """

    name: str
    title: str = ""
    definition: str = ""


class AnnotatedSequence(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One sequence with one target.

    Attributes:
        name: unique in the dataset, a plain file name.
        frames: its image files.
        boxes: x, y, w, h of the top-left corner and the size in pixels from 0; one row a frame, or
            one row a keyframe where `keyframes` is given. `null` in a row is NaN: absent target.
            `null` instead of the list: no annotation.
        keyframes: indices of the annotated frames, from 0, where only some are.
        visible: 1 where the target can be seen, one a frame; `null` where not published.
        absent: GOT-10k `absence.label`: 1 where the target is out of view or fully hidden.
        cover: GOT-10k `cover.label`: visible share of the target in steps of 1/8, 0 to 8.
        cut_by_image: GOT-10k `cut_by_image.label`: 1 where the image's edge cuts the target.
        category: what the target is, such as `car`.
        activity: what it does, such as `cycling`.
        attributes: provenance by abbreviation, for the attributes that the sequence has.
        resolution: width and height in pixels.
        fps: frames a second.
        extra: further published facts as text, by a name such as `got10k.url`.
    """

    name: str
    frames: FrameFiles
    boxes: tuple[Row, ...] | None = None
    keyframes: tuple[int, ...] | None = None
    visible: tuple[Flag, ...] | None = None
    absent: tuple[Flag, ...] | None = None
    cover: tuple[int, ...] | None = None
    cut_by_image: tuple[Flag, ...] | None = None
    category: str = ""
    activity: str = ""
    attributes: dict[str, Provenance] = msgspec.field(default_factory=dict)
    resolution: tuple[int, int] | None = None
    fps: float | None = None
    extra: dict[str, str] = msgspec.field(default_factory=dict)


class AnnotatedDataset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A whole dataset.

    Attributes:
        schema: version of the schema.
        name: of the dataset, a plain file name.
        title: name as papers write it.
        version: of the dataset, as its authors count.
        licence: of frames and ground truth.
        citation: where it was published.
        fps: frames a second of sequences that name none.
        resolution: width and height in pixels of sequences that name none.
        attributes: every attribute that a sequence may have, in published order.
        sequences: sorted by name.
    """

    schema: Literal["nat-bench/1"] = "nat-bench/1"
    name: str
    title: str = ""
    version: str = ""
    licence: str = ""
    citation: str = ""
    fps: float | None = None
    resolution: tuple[int, int] | None = None
    attributes: tuple[AttributeTerm, ...] = ()
    sequences: tuple[AnnotatedSequence, ...]

    @property
    def attribute_names(self) -> tuple[str, ...]:
        """Abbreviations in published order."""
        return tuple(term.name for term in self.attributes)


class KeptSequence(AnnotatedSequence, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A sequence in the side file of a foreign format.

    Attributes:
        native: names of the fields whose values stand in the format's own files.
    """

    native: tuple[str, ...] = ()


class KeptDataset(AnnotatedDataset, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a foreign format has no field for: its side file `nat-bench-extra.json`.

    Attributes:
        format: the foreign format.
        sequences: with all but the fields that are native.
    """

    format: str
    sequences: tuple[KeptSequence, ...]


def json_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of an index file."""
    schema = msgspec.json.schema(AnnotatedDataset)
    for definition in schema["$defs"].values():
        _describe(definition)
    whole = schema["$defs"][AnnotatedDataset.__name__]
    whole["required"] = ["schema", *whole["required"]]
    title = f"Night tracking dataset annotation, {VERSION}"
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema}


def _describe(definition: dict[str, Any]) -> None:
    """Move the words on each attribute from the docstring of a struct to its properties."""
    summary, _, rest = inspect.cleandoc(definition["description"]).partition("Attributes:\n")
    definition["description"] = " ".join(summary.split())
    for name, words in _ENTRY.findall(textwrap.dedent(rest)):
        definition["properties"][name]["description"] = " ".join(words.split())


def decode_dataset(raw: bytes, where: str) -> AnnotatedDataset:
    """Read and check the JSON of an index file; `where` is named in errors.

    Raises:
        AnnotationInvalid: no JSON, another version, unknown or missing fields, values that do
            not fit together, or names that lead out of the folder.
    """
    document: AnnotatedDataset = _decode(raw, where, AnnotatedDataset)
    return document


def decode_kept(raw: bytes, where: str) -> KeptDataset:
    """Read the JSON of a side file; see `decode_dataset`. Boxes may be missing in it."""
    document: KeptDataset = _decode(raw, where, KeptDataset)
    return document


class _Version(msgspec.Struct):
    schema: str = ""


def _decode(raw: bytes, where: str, kind: Any) -> Any:
    try:
        version = msgspec.json.decode(raw, type=_Version).schema
        if version == VERSION:
            return msgspec.json.decode(raw, type=kind)
        named = f"schema {version!r}" if version else "names no schema"
        msg = f"{where}: {named}, but this version of nat-bench reads {VERSION!r}"
    except msgspec.ValidationError as error:
        msg = f"{where}: {error}"
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        msg = f"{where}: no valid JSON ({error})"
    raise AnnotationInvalid(msg)


def read_bytes(path: Path) -> bytes:
    """The bytes of an annotation file, in a folder or an archive.

    Raises:
        AnnotationInvalid: they cannot be read.
    """
    try:
        return archives.read_bytes(path)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise AnnotationInvalid(msg) from None


def encode_dataset(document: AnnotatedDataset) -> bytes:
    """JSON of a dataset, one line a sequence; fields that have their default are left out."""
    head = _trimmed(msgspec.structs.replace(document, sequences=()))
    head = {"schema": document.schema, **head}
    head.pop("sequences", None)
    lines = [f'  "{key}": {_json(value)},\n' for key, value in head.items()]
    rows = ",\n".join(f"    {_json(_trimmed(s))}" for s in document.sequences)
    body = f"[\n{rows}\n  ]" if rows else "[]"
    return ("{\n" + "".join(lines) + f'  "sequences": {body}\n}}\n').encode()


def _trimmed(value: Any) -> Any:
    """Nested plain dictionaries without the fields that have their default."""
    if isinstance(value, msgspec.Struct):
        fields = {f.name: f for f in msgspec.structs.fields(value)}
        found = {name: getattr(value, name) for name in fields}
        return {n: _trimmed(v) for n, v in found.items() if not _is_default(fields[n], v)}
    if isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
        return [_trimmed(one) for one in value]
    return value


def _is_default(field: msgspec.structs.FieldInfo, value: Any) -> bool:
    if field.default_factory is dict:
        return not value
    return field.default is not msgspec.NODEFAULT and bool(field.default == value)


def _json(value: Any) -> str:
    try:
        return msgspec.json.encode(value).decode()
    except UnicodeEncodeError as error:
        msg = f"{error.object!a}: a name that is no Unicode text; rename this file"
        raise AnnotationInvalid(msg) from None
