"""Which folder layout is this: frames and annotation of every sequence, found by looking.

Three kinds are known, in any case of the folder names:

* `apart`: `data_seq/NAME/*.jpg`, `Sequences/NAME/*.jpg` or `train_clip/NAME/*.jpg` with
  `anno_revise/NAME.txt`, `anno/NAME.txt` or `anno_keyframes/NAME.txt` beside, and `att/NAME.txt`
  where attributes are published;
* `each`: one folder a sequence with its box file inside and the frames in it or in `img/` (OTB,
  DTB70, GOT-10k, LaSOT), also below folders of categories;
* `single`: the frames of one sequence directly in the folder, with one box file.

A folder that only wraps one of these (`NAT2021/data_seq`) is looked into. In place of a folder of
frames a video may lie (`data_seq/NAME.mp4`), a folder of videos with `NAME.txt` beside each is read
like `each`, a single video like `single`, and a .zip archive like the folder that it holds. Only
names are listed here; no image, video or annotation is opened.
"""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

from nat2024.archives import is_archive
from nat2024.datasets.frames import FolderFrames, StoredFrames
from nat2024.datasets.listings import Listing, path_kind
from nat2024.datasets.schema import AnnotatedDataset, AnnotatedSequence
from nat2024.datasets.video import VIDEO_EXTENSIONS, VideoFrames
from nat2024.errors import DatasetIncomplete, DatasetNotFound

Kind: TypeAlias = Literal["apart", "each", "single", "described"]

TRAINING_CLIPS = "train_clip"
FRAME_FOLDERS = ("data_seq", "sequences", TRAINING_CLIPS)
_BOXES = ("anno_revise", "anno", "annotation", "annotations")
_KEYFRAMES = ("anno_keyframes",)
ATTRIBUTE_FOLDERS = ("att", "attr", "attributes")
_INNER_FRAMES = ("img", "imgs", "image", "images", "frames", "color")
_BOX_FILES = ("groundtruth_rect.txt", "groundtruth.txt", "anno.txt", "gt.txt")
_NO_BOX_FILES = frozenset({"nlp.txt", "att.txt", "full_occlusion.txt", "out_of_view.txt"})
_NO_SEQUENCES = frozenset({*_BOXES, *_KEYFRAMES, *ATTRIBUTE_FOLDERS, "__macosx"})
_DEPTH = 2  # NAT2021/test/data_seq


@dataclass(frozen=True, slots=True)
class FoundSequence:
    """Where one sequence lies.

    Attributes:
        name: folder name of the sequence, or that of its video without the ending.
        folder: the sequence's own folder, or the one that holds its video.
        frames: its images or its video; may be empty.
        boxes: file with a box for every frame, if any.
        keyframes: file with boxes of some frames, if any.
        attributes: file of 0/1 flags, if any.
        side_files: names of the files in `folder` that are no images, such as `absence.label`.
        links: names of those frames that are symbolic links.
        record: its annotation, where a file describes the whole dataset.
    """

    name: str
    folder: Path
    frames: StoredFrames
    boxes: Path | None = None
    keyframes: Path | None = None
    attributes: Path | None = None
    side_files: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    record: AnnotatedSequence | None = None


@dataclass(frozen=True, slots=True)
class Layout:
    """A recognised folder.

    Attributes:
        kind: `apart`, `each` or `single`; see the module. `described` where an annotation file
            names the frames.
        folder: the folder that holds the parts, perhaps inside the one that was asked for.
        words: the layout in words.
        sequences: sorted by name.
        without_frames: names of box files to which there is no folder of frames.
        empty: names of folders with neither images nor boxes where a sequence was expected.
        document: the annotation file that describes the dataset, if there is one.
        remarks: what that file holds but is not kept, one line each.
    """

    kind: Kind
    folder: Path
    words: str
    sequences: tuple[FoundSequence, ...]
    without_frames: tuple[str, ...] = ()
    empty: tuple[str, ...] = ()
    document: AnnotatedDataset | None = None
    remarks: tuple[str, ...] = ()


def find_layouts(folder: Path) -> tuple[Layout, ...]:
    """Recognise the layout of `folder`, or of each of several datasets that lie in it.

    Args:
        folder: also a .zip archive, or a single video.

    Raises:
        DatasetNotFound: it is absent, no folder, empty, or nothing in it looks like a dataset.
        DatasetIncomplete: two sequences have one name, a name cannot be printed, or it is an
            archive that is refused.
    """
    kind = path_kind(folder)
    if kind == "absent":
        msg = f"{folder}: no such folder"
        raise DatasetNotFound(msg)
    if kind == "file" and folder.suffix.lower() in VIDEO_EXTENSIONS:
        return tuple(_single_video(folder))
    if kind == "file" and not is_archive(folder):
        msg = f"{folder}: a file, but a dataset is a folder of sequences, a .zip of one, or a video"
        raise DatasetNotFound(msg)
    listing = Listing.of(folder)
    layouts = _look(listing, _DEPTH)
    if not layouts:
        what = "the folder is empty" if listing.is_empty else "no images in it"
        msg = (
            f"{folder}: {what}; expected data_seq/NAME/*.jpg with anno/NAME.txt, or NAME/*.jpg "
            "with a box file such as groundtruth.txt, or the images of one sequence"
        )
        raise DatasetNotFound(msg)
    return tuple(layouts)


def find_layout(folder: Path) -> Layout:
    """Recognise the layout of a folder that holds one dataset; see `find_layouts`.

    Raises:
        DatasetNotFound, DatasetIncomplete: as `find_layouts`, or it holds several datasets.
    """
    return only_layout(folder, find_layouts(folder))


def only_layout(folder: Path, layouts: tuple[Layout, ...]) -> Layout:
    """The one layout of a folder; `DatasetIncomplete` names them where there are several."""
    if len(layouts) == 1:
        return layouts[0]
    names = ", ".join(sorted(str(layout.folder.relative_to(folder)) for layout in layouts))
    msg = f"{folder}: holds {len(layouts)} datasets ({names}); pass one of these folders"
    raise DatasetIncomplete(msg)


@dataclass(frozen=True, slots=True)
class SideFiles:
    """The annotation folders beside the frames, the preferred one first."""

    boxes: tuple[Listing, ...]
    keyframes: tuple[Listing, ...]
    attributes: tuple[Listing, ...]

    @classmethod
    def of(cls, base: Listing) -> "SideFiles":
        """Those in a listed folder."""
        boxes = base.inside(*_BOXES)
        within = tuple(found for listing in boxes for found in listing.inside(*ATTRIBUTE_FOLDERS))
        return cls(boxes, base.inside(*_KEYFRAMES), (*base.inside(*ATTRIBUTE_FOLDERS), *within))

    def words(self) -> str:
        """Names of the folders, as they are written on disk."""
        parts = (*self.boxes, *self.keyframes, *self.attributes)
        return "".join(f" + {part.path.name}/" for part in parts)

    def sequence(self, name: str, listing: Listing, own: Path | None) -> FoundSequence:
        """The sequence whose folder is listed, `own` being the box file in that folder."""
        holder = _frames_folder(listing)
        return FoundSequence(
            name,
            listing.path,
            _frames(holder),
            _first_file(self.boxes, f"{name}.txt", f"{name}_gt.txt") or own,
            _first_file(self.keyframes, f"{name}.txt"),
            _first_file(self.attributes, f"{name}.txt", f"{name}_att.txt"),
            listing.files,
            tuple(sorted(holder.links.intersection(holder.images or holder.videos))),
        )

    def video(self, listing: Listing, file: str, own: Path | None = None) -> FoundSequence:
        """The sequence that is a video file of the listed folder, `own` its box file if named."""
        name = Path(file).stem
        own = own or listing.file(f"{name}.txt", f"{name}_gt.txt")
        return FoundSequence(
            name,
            listing.path,
            VideoFrames(listing.path / file),
            _first_file(self.boxes, f"{name}.txt", f"{name}_gt.txt") or own,
            _first_file(self.keyframes, f"{name}.txt"),
            _first_file(self.attributes, f"{name}.txt", f"{name}_att.txt"),
            links=(file,) if file in listing.links else (),
        )

    def annotated(self, name: str) -> FoundSequence | None:
        """The sequence of the box file `NAME.txt`, without frames; None where there is no such."""
        boxes = _first_file(self.boxes, f"{name}.txt")
        if boxes is None:
            return None
        plain = name[: -len("_gt")] if name.lower().endswith("_gt") else name
        flags = _first_file(self.attributes, f"{plain}.txt", f"{plain}_att.txt")
        frames = FolderFrames(boxes.parent, ())
        return FoundSequence(plain, boxes.parent, frames, boxes, attributes=flags)

    def unused(self, names: set[str]) -> tuple[str, ...]:
        """Names of box files that belong to none of the sequences `names`."""
        known = {name.lower() for name in names} | {"readme"}
        texts = {Path(f) for x in self.boxes for f in x.files if f.lower().endswith(".txt")}
        stems = {text.stem for text in texts}
        return tuple(sorted(s for s in stems if s.lower().removesuffix("_gt") not in known))


def _first_file(listings: tuple[Listing, ...], *names: str) -> Path | None:
    found = (listing.file(*names) for listing in listings)
    return next((path for path in found if path), None)


def _look(listing: Listing, depth: int) -> list[Layout]:
    apart = listing.inside(*FRAME_FOLDERS)
    if apart:
        return _frames_apart(listing, apart[0])
    if _is_sequence(listing):
        return _single_sequence(listing)
    children = [listing.child(n) for n in listing.folders if n.lower() not in _NO_SEQUENCES]
    wraps = any(child.inside(*FRAME_FOLDERS) for child in children)
    here = [] if wraps else _one_folder_each(listing, children)
    if not here and not wraps and listing.images:
        here = _single_sequence(listing)
    if depth == 0 or any(s.boxes or s.keyframes for layout in here for s in layout.sequences):
        return here
    inside = _look_inside(listing, children, depth - 1)
    # pictures beside a dataset are no dataset: what lies deeper goes before, if it is one
    return [x for x in inside if x.kind == "apart"] or here or inside or _videos(listing)


def _is_sequence(listing: Listing) -> bool:
    """Whether frames and a box file of a well-known name lie here together."""
    return listing.file(*_BOX_FILES) is not None and bool(_frames(_frames_folder(listing)))


def _frames_apart(base: Listing, frames: Listing) -> list[Layout]:
    side = SideFiles.of(base)
    children = [frames.child(n) for n in frames.folders if n.lower() not in _NO_SEQUENCES]
    found = [side.sequence(x.path.name, x, x.file(*_BOX_FILES)) for x in children]
    folders = {s.name for s in found if s.frames}
    videos = [side.video(frames, v) for v in frames.videos if Path(v).stem not in folders]
    without = {s.name for s in videos}
    found = [s for s in found if s.name not in without] + videos
    empty = tuple(s.name for s in found if not (s.frames or s.boxes or s.keyframes))
    found = [s for s in found if s.name not in empty]
    if not any(s.frames for s in found):
        return []
    words = f"{frames.path.name}/{side.words()}"
    unused = side.unused({s.name for s in found})
    return [
        replace(make_layout("apart", base.path, words, found), without_frames=unused, empty=empty)
    ]


def _single_sequence(listing: Listing) -> list[Layout]:
    name = listing.path.resolve().name
    side = SideFiles.of(listing)
    found = side.sequence(name, listing, own_boxes(listing))
    words = "images of one sequence" + (f" + {found.boxes.name}" if found.boxes else "")
    return [make_layout("single", listing.path, words, [found])]


def _one_folder_each(listing: Listing, children: list[Listing]) -> list[Layout]:
    side = SideFiles.of(listing)
    looked = [(x, side.sequence(x.path.name, x, own_boxes(x))) for x in children]
    found = [s for child, s in looked if _is_wanted(s) or child.file(*_BOX_FILES)]
    if not any(sequence.frames for sequence in found):
        return []
    inner = next((s.frames.folder.name for s in found if s.frames.folder != s.folder), None)
    own = sorted({s.boxes.name for s in found if s.boxes and s.boxes.parent == s.folder})
    words = f"NAME/{inner}/" if inner else "NAME/"
    words += f" + NAME/{own[0]}" if len(own) == 1 else " + NAME/*.txt" if own else ""
    return [make_layout("each", listing.path, words + side.words(), found)]


def _look_inside(listing: Listing, children: list[Listing], depth: int) -> list[Layout]:
    """Datasets in sub-folders, or sequences below folders of categories."""
    layouts = [layout for child in children for layout in _look(child, depth)]
    layouts = [layout for layout in layouts if layout.kind == "apart"] or layouts
    if len(layouts) > 1 and all(layout.kind == "each" for layout in layouts):
        found = [sequence for layout in layouts for sequence in layout.sequences]
        return [make_layout("each", listing.path, f"CATEGORY/{layouts[0].words}", found)]
    return layouts


def _is_wanted(found: FoundSequence) -> bool:
    """Whether a folder is a sequence; one with a video but no boxes is some other folder."""
    is_video = isinstance(found.frames, VideoFrames)
    return bool(found.frames) and (not is_video or bool(found.boxes or found.keyframes))


def _videos(listing: Listing) -> list[Layout]:
    """Videos directly in a folder, each with its box file beside it."""
    if not listing.videos:
        return []
    side = SideFiles.of(listing)
    alone = own_boxes(listing) if len(listing.videos) == 1 else None
    found = [side.video(listing, video, alone) for video in listing.videos]
    return [make_layout("each", listing.path, f"videos + NAME.txt{side.words()}", found)]


def _single_video(path: Path) -> list[Layout]:
    """One video that was asked for itself."""
    listing = Listing.of(path.parent)
    found = replace(SideFiles.of(listing).video(listing, path.name), links=())
    words = "one video" + (f" + {found.boxes.name}" if found.boxes else "")
    return [make_layout("single", path, words, [found])]


def _frames_folder(listing: Listing) -> Listing:
    """Where the images of one sequence lie, in its folder or in `img/`."""
    inner = () if listing.images else listing.inside(*_INNER_FRAMES)
    return next((x for x in inner if x.images), listing)


def _frames(holder: Listing) -> StoredFrames:
    """The images of a folder, or its only video where it has no images."""
    if not holder.images and len(holder.videos) == 1:
        return VideoFrames(holder.path / holder.videos[0])
    return FolderFrames(holder.path, holder.images)


def own_boxes(listing: Listing) -> Path | None:
    """The box file in a sequence's own folder: of a known name, or its only text file."""
    names = (listing.path.name, listing.path.resolve().name)
    named = [f"{name}{end}.txt" for name in names for end in ("", "_gt")]
    known = listing.file(*_BOX_FILES, *named)
    if known is not None:
        return known
    texts = [f for f in listing.files if f.lower().endswith(".txt")]
    texts = [f for f in texts if f.lower() not in _NO_BOX_FILES and "readme" not in f.lower()]
    return listing.path / texts[0] if len(texts) == 1 else None


def make_layout(kind: Kind, folder: Path, words: str, found: list[FoundSequence]) -> Layout:
    """A layout of these sequences.

    Raises:
        DatasetIncomplete: two have one name, or a name cannot be printed.
    """
    found = sorted(found, key=lambda sequence: sequence.name)
    strange = [s.name for s in found if not s.name.isprintable()]
    if strange:
        msg = f"{folder}: sequence {strange[0]!a}: not a printable name; rename its folder"
        raise DatasetIncomplete(msg)
    twice = [a.name for a, b in itertools.pairwise(found) if a.name == b.name]
    if twice:
        msg = f"{folder}: two sequences are called {twice[0]}; names must differ"
        raise DatasetIncomplete(msg)
    return Layout(kind, folder, words, tuple(found))
