"""What is computed from frames: light, light at a loss, thumbnails; each kept once it is known."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from nat2024.analysis import LightTrace, Moment, trace_light
from nat2024.errors import FrameUnreadable
from nat2024.evidence.enhancers import RunEnhancer
from nat2024.evidence.keeping import digest, frame_identity
from nat2024.evidence.records import Corners, LossEvidence, Thumbnail, TrackEvidence
from nat2024.keeping import Keeper
from nat2024.measures import local_grey, target_light_spread
from nat2024.types import Box, Boxes, Floats, Image
from nat2024.types import Sequence as FrameSequence

LIGHT_FRAMES = 60
"""At most so many frames of a sequence are looked at for its light."""

THUMBNAIL_SIZE = (320, 240)
"""Width and height of thumbnails in pixels."""

_CONTEXT = 2.0  # sides of the region of the luminance over those of the box
_QUALITY = 70  # of the JPEG
_SIDES = 8.0  # width of a thumbnail's region over the size of the target
_LEAST_WIDTH = 96  # pixels of the frame


class _Light(msgspec.Struct):
    columns: list[list[float]]


class _Loss(msgspec.Struct):
    luminance: float
    unevenness: float


class _Picture(msgspec.Struct):
    jpeg: bytes
    left: float
    top: float
    scale: float


@dataclass(frozen=True, slots=True)
class Looker:
    """Looks at the frames of one sequence.

    Attributes:
        sequence: whose frames.
        truth: float64 (n, 4), NaN where not known.
        keeper: what is known already.
        on_frame: called for each frame decoded.
        on_unreadable: called with the error of a frame that is left out.
    """

    sequence: FrameSequence
    truth: Boxes
    keeper: Keeper
    on_frame: Callable[[], object]
    on_unreadable: Callable[[FrameUnreadable], object]

    def has_images(self) -> bool:
        """Whether any of three frames can be decoded."""
        count = len(self.sequence)
        identities = [frame_identity(self.sequence, i) for i in {0, count // 2, count - 1}]
        if count and all(identities):  # there are files; whether they decode is seen later
            return True
        for index in dict.fromkeys((0, count // 2, count - 1)) if count else ():
            try:
                self.sequence.image(index)
            except FrameUnreadable:
                continue
            return True
        return False

    def light(self, every: int | None) -> LightTrace | None:
        """The light of every `every`-th frame; None where none of them can be decoded."""
        count = len(self.sequence)
        every = every or max(1, -(-count // LIGHT_FRAMES))
        indices = np.arange(0, count, every)
        identities = [frame_identity(self.sequence, i) for i in indices.tolist()]
        boxes = self.truth[indices]
        key = digest("light", every, identities, boxes) if all(identities) else None
        stored = self.keeper.get(key, _Light)
        if stored is not None:
            return LightTrace(indices, *map(np.array, stored.columns))
        seen = FrameSequence(self.sequence.name, self.sequence.frames, self.truth)
        trace = trace_light(
            seen, every=every, on_frame=self.on_frame, on_unreadable=self.on_unreadable
        )
        if np.isnan(trace.mean).all():
            return None
        if not np.isnan(trace.mean).any():  # what could not be read may be there next time
            self.keeper.put(key, _Light([column.tolist() for column in _columns(trace)]))
        return trace

    def at_loss(self, track: TrackEvidence, enhancer: RunEnhancer | None) -> LossEvidence | None:
        """The light where a run lost its target first, and what its enhancer did to it."""
        frame = track.first_loss
        if frame is None:
            return None
        identity = frame_identity(self.sequence, frame)
        image: Image | None = None
        key = digest("loss", identity, self.truth[frame]) if identity else None
        loss = self.keeper.get(key, _Loss)
        if loss is None:
            image = self._read(frame)
            loss = _Loss(float("nan"), float("nan"))
            if image is not None:
                loss = _light_around(image, self.truth[frame])
                self.keeper.put(key, loss)
        over = float("nan")
        if enhancer is not None and enhancer.record is not None:
            over = self._over_enhancement(track, frame, identity, image, enhancer)
        return LossEvidence(frame, loss.luminance, loss.unevenness, over)

    def _over_enhancement(
        self,
        track: TrackEvidence,
        frame: int,
        identity: str | None,
        image: Image | None,
        enhancer: RunEnhancer,
    ) -> float:
        around = _searched(track)
        if around is None:
            around = self.truth[frame]
        key = digest("over", identity, around, enhancer.identity) if identity else None
        stored = self.keeper.get(key, float)
        if stored is not None:
            return stored
        image = self._read(frame) if image is None else image
        if image is None:
            return float("nan")
        value = enhancer.over_enhancement(image, around)
        if not enhancer.problem:
            self.keeper.put(key, value)
        return value

    def thumbnail(
        self, frame: int, moment: Moment, tracks: Sequence[TrackEvidence]
    ) -> Thumbnail | None:
        """A picture around the target, or the first track's box where no truth is known."""
        target = self.truth[frame]
        identity = frame_identity(self.sequence, frame)
        size = list(THUMBNAIL_SIZE)
        key = digest("thumbnail", identity, target, size, _QUALITY) if identity else None
        picture = self.keeper.get(key, _Picture)
        if picture is None:
            image = self._read(frame)
            if image is None:
                return None
            picture = _picture(image, target)
            self.keeper.put(key, picture)
        boxes = {t.run: box for t in tracks if (box := t.box_at(frame)) is not None}
        known = bool(np.isfinite(target).all())
        return Thumbnail(
            frame=frame,
            reasons=moment.reasons,
            run=moment.run,
            jpeg=picture.jpeg,
            width=THUMBNAIL_SIZE[0],
            height=THUMBNAIL_SIZE[1],
            truth=_placed(target, picture) if known else None,
            boxes={run: _placed(box, picture) for run, box in boxes.items()},
        )

    def _read(self, frame: int) -> Image | None:
        try:
            image = self.sequence.image(frame)
        except FrameUnreadable as error:
            self.on_unreadable(error)
            return None
        self.on_frame()
        return image


def _columns(trace: LightTrace) -> list[Floats]:
    return [
        trace.mean,
        trace.spread,
        trace.saturated_beside_dark,
        trace.target,
        trace.around,
        trace.target_spread,
    ]


def _light_around(image: Image, box: Box) -> _Loss:
    return _Loss(local_grey(image, box, _CONTEXT), target_light_spread(image, box))


def _searched(track: TrackEvidence) -> Box | None:
    """The last usable box before the first loss: around it the tracker searched."""
    row = track.failure.first_loss
    for earlier in range((row or 0) - 1, -1, -1):
        box: Box = track.boxes[earlier]
        if np.isfinite(box).all() and (box[2:] > 0).all():
            return box
    return None


def _picture(image: Image, target: Box) -> _Picture:
    """The part of a frame around a target, with what lies outside of the frame in black."""
    import cv2

    width, height = THUMBNAIL_SIZE
    frame_height, frame_width = image.shape[:2]
    if np.isfinite(target).all() and (target[2:] > 0).all():
        centre = target[:2] + target[2:] / 2
        wanted = max(_SIDES * float(np.sqrt(target[2] * target[3])), 1.5 * float(target[2:].max()))
        region = min(max(wanted, _LEAST_WIDTH), frame_width, frame_height * width / height)
    else:
        centre = np.array([frame_width / 2, frame_height / 2])
        region = min(frame_width, frame_height * width / height)
    scale = width / region
    half = np.array([region, region * height / width]) / 2
    limits = np.array([frame_width, frame_height])
    low = np.clip(centre - half, 0, np.maximum(0, limits - 2 * half))  # inside of the frame
    # OpenCV counts from the middle of the first pixel, boxes from its edge
    shift = (scale - 1) / 2 - scale * low
    warp = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    left, top = np.floor(low).astype(int)
    right, bottom = np.minimum(np.ceil(low + 2 * half).astype(int), limits)
    if scale < 1:
        part = np.ascontiguousarray(image[top:bottom, left:right])
        view = cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)
        low, scale = np.array([left, top], dtype=np.float64), width / (right - left)
    else:
        view = cv2.warpAffine(image, warp, (width, height), flags=cv2.INTER_LINEAR)
    _, encoded = cv2.imencode(".jpg", view, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return _Picture(encoded.tobytes(), float(low[0]), float(low[1]), float(scale))


def _placed(box: Box, picture: _Picture) -> Corners:
    x, y, w, h = np.round(
        (box - np.array([picture.left, picture.top, 0, 0])) * picture.scale, 1
    ).tolist()
    return (x, y, w, h)
