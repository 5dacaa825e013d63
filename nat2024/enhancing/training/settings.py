"""What enhancers are trained on: size, order and augmentation of the pictures."""

from typing import Annotated, Literal

import msgspec

Count = Annotated[int, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class PictureSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How pictures become batches.

    Attributes:
        every: take every so many-th frame of a sequence or video; 0 takes every 50th, as
            NAT2021-light was made of NAT2021-train. A plain folder is taken whole then.
        size: side of the square pictures, pixels.
        fit: "resize" whole pictures to that size, or "crop" a window of it at a random place;
            labels are made before the window is cut.
        crop: side of the part of each picture that a step sees, one place a batch; 0 for all.
        crop_multiple: that place is a multiple of this.
        full_size_steps: so many last steps see whole pictures.
        mirror: how often a picture is mirrored.
        swap_red_blue: how often red and blue of a batch are swapped, labels included.
        draw: "epoch" goes through all pictures in a new order each round, "uniform" draws with
            replacement.
        held_out: pictures left out of training, for validation; at most a quarter of all.
        recalibrate: batches of whole pictures whose statistics BatchNorm gets in the end, dropout
            off; 0 keeps the running ones.
        workers: threads that read ahead and make labels; results do not depend on it.
    """

    every: Count = 0
    size: Annotated[int, msgspec.Meta(ge=16)] = 256
    fit: Literal["resize", "crop"] = "resize"
    crop: Count = 0
    crop_multiple: Annotated[int, msgspec.Meta(ge=1)] = 16
    full_size_steps: Count = 0
    mirror: Share = 0.0
    swap_red_blue: Share = 0.0
    draw: Literal["epoch", "uniform"] = "epoch"
    held_out: Count = 16
    recalibrate: Count = 0
    workers: Count = 0
