"""The trackers `opencv_csrt` and `opencv_kcf`, which only OpenCV's contrib build has.

They are listed in any case; without that build, creating one says what is missing.
"""

from typing import Any, ClassVar

from nat2024.cards import Card
from nat2024.registry import register_tracker
from nat2024_trackers.opencv.base import OpenCVFailure, OpenCVTracker

_STATE = (
    "untested; OpenCV's own implementation, for which the package opencv-contrib-python-headless "
    "must take the place of opencv-python-headless"
)
_CODE = "https://github.com/opencv/opencv_contrib (modules/tracking)"
_DIFFERENCES = (
    "whole frames only: the tracker cuts out what it sees inside OpenCV",
    "boxes are rounded to integers; a start box larger than the image is cut to it",
    "it has no score: NaN is reported",
)


class ContribTracker(OpenCVTracker):
    """What both share; a subclass names the class of OpenCV.

    Attributes:
        opencv_class: such as "TrackerCSRT", of `cv2` or of `cv2.legacy`.
    """

    opencv_class: ClassVar[str]

    def __init__(self, **base: Any) -> None:
        """Make sure that this build of OpenCV has the tracker.

        Args:
            base: `enhancer`, `device`, `scope`, of which there is only "frame".

        Raises:
            OpenCVFailure: it has not; says which package has.
        """
        super().__init__(**base)
        self._find_class()

    def make(self) -> Any:
        """A new tracker with OpenCV's default parameters."""
        return self._find_class().create()

    def _find_class(self) -> Any:
        import cv2

        # The contrib build of OpenCV 4 has them in both places, older ones only in `legacy`.
        for place in (cv2, getattr(cv2, "legacy", None)):
            found: Any = getattr(place, self.opencv_class, None)
            if found is not None:
                return found
        msg = (
            f"{self.name}: OpenCV {cv2.__version__} here has no {self.opencv_class}; it comes with "
            "the package opencv-contrib-python-headless, in place of opencv-python-headless"
        )
        raise OpenCVFailure(msg)


@register_tracker("opencv_csrt")
class OpenCVCSRT(ContribTracker):
    """Discriminative correlation filters with channel and spatial reliability."""

    opencv_class: ClassVar[str] = "TrackerCSRT"
    card: ClassVar[Card] = Card(
        title="CSRT (OpenCV)",
        summary="Correlation filters on HOG and colour names with reliability maps; follows size.",
        paper=(
            "A. Lukezic, T. Vojir, L. Cehovin Zajc, J. Matas, M. Kristan: Discriminative "
            "Correlation Filter with Channel and Spatial Reliability, CVPR 2017"
        ),
        code=_CODE,
        code_licence="Apache-2.0",
        colour_order="BGR, as OpenCV reads it",
        scopes=("frame",),
        state=_STATE,
        differences=_DIFFERENCES,
    )


@register_tracker("opencv_kcf")
class OpenCVKCF(ContribTracker):
    """Kernelised correlation filters; the size of the box never changes."""

    opencv_class: ClassVar[str] = "TrackerKCF"
    card: ClassVar[Card] = Card(
        title="KCF (OpenCV)",
        summary="Kernelised correlation filters on colour names and grey; constant box size.",
        paper=(
            "J. F. Henriques, R. Caseiro, P. Martins, J. Batista: High-Speed Tracking with "
            "Kernelized Correlation Filters, TPAMI 2015"
        ),
        code=_CODE,
        code_licence="Apache-2.0",
        colour_order="BGR, as OpenCV reads it",
        scopes=("frame",),
        state=_STATE,
        differences=(
            *_DIFFERENCES,
            "where its response is weak it reports a loss, and the last box stays",
            "kcf is our own implementation, with other features",
        ),
    )
