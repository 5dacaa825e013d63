import numpy as np
import pytest

from nat2024_reports.figures.looks import Look
from nat2024_reports.overlays import DrawnBox, bgr, draw_boxes, draw_into
from nat2024_reports.video_frames import Scene, panel_size, video_frame, video_size

RED = (0, 0, 255)
LOOKS = {
    "t": Look("T", "#0072B2", True, "", "o"),
    "t+e": Look("T + E…", "#0072B2", False, "", "s"),
}


def grey(height: int = 90, width: int = 160) -> np.ndarray:
    return np.full((height, width, 3), 90, np.uint8)


def test_solid_boxes_are_closed_and_dashed_ones_have_gaps_and_corners() -> None:
    for is_dashed in (False, True):
        image = grey()
        draw_into(image, [DrawnBox(np.array([20.0, 10, 80, 60]), RED, is_dashed)], 1)
        top = (image[10, 20:101, 2] > 150) & (image[10, 20:101, 0] < 60)
        assert top[0]
        assert top[-1]
        assert top.all() == (not is_dashed)
        assert top.mean() > 0.4
        assert (image[30, 40] == 90).all()


def test_dark_boxes_have_a_light_edge_and_others_a_dark_one() -> None:
    for color, edge in ((bgr("#000000"), 255), (bgr("#332288"), 255), (RED, 0)):
        image = grey()
        draw_into(image, [DrawnBox(np.array([20.0, 10, 80, 60]), color)], 1, halo=True)
        assert abs(int(image[12, 60].mean()) - edge) < 60
    black = {"t": Look("T", "#000000", True, "", "o")}
    legend = video_frame(Scene(0, {"": grey(90, 640)}), black, (640, 90))[90:]
    assert legend[:, 326:362].max() > 200  # the line before the name, in the second column


def test_bad_boxes_are_left_out_and_far_ones_harm_nothing() -> None:
    image = grey()
    boxes = [np.full(4, np.nan), np.array([1e12, -1e12, 4, 4]), np.array([-1e9, -1e9, 2e9, 2e9])]
    for is_dashed in (False, True):
        draw_into(image, [DrawnBox(box, RED, is_dashed) for box in boxes], 1, halo=True)
    assert (image == 90).all()


def test_the_frame_itself_is_not_changed() -> None:
    image = grey()
    drawn = draw_boxes(image, np.array([5.0, 5, 20, 20]), None, ("text",))
    assert (image == 90).all()
    assert (drawn != 90).any()


def test_video_frames_have_one_even_size() -> None:
    assert bgr("#0072B2") == (178, 114, 0)
    box = np.array([60.0, 40, 12, 10])
    for panels in ({"": grey()}, {"original": grey(), "LDEnhancer": None}):
        scene = Scene(7, panels, box, {"t": box + 3, "t+e": None}, {"t": 0.5, "t+e": np.nan})
        frame = video_frame(scene, LOOKS, (160, 90))
        width, height = video_size((160, 90), len(panels), LOOKS)
        assert frame.shape == (height, width, 3)
        assert (width % 2, height % 2) == (0, 0)
    blind = video_frame(Scene(0, {"": grey()}), LOOKS, (160, 90), inset=False)
    assert blind.shape[1] == 160
    assert panel_size((1921, 1081), 2) == (640, 360)
    assert panel_size((161, 91), 1) == (160, 90)


def test_long_names_in_the_legend_get_wider_columns_before_they_are_cut() -> None:
    def bright_beyond(label: str, width: int) -> tuple[int, int]:
        """Height of the legend, and where its writing ends in the row of the last run."""
        looks = {str(n): Look(label, "#0072B2", False, "", "o") for n in range(2)}
        scene = Scene(0, {"": grey(90, width)}, overlaps=dict.fromkeys(looks, 0.53))
        legend = video_frame(scene, looks, (width, 90), inset=False)[90:]
        return legend.shape[0], int(np.flatnonzero(legend.max(axis=(0, 2)) > 100)[-1])

    long = "SiamRPN++ (compact) + EnlightenGAN@fine"
    assert bright_beyond("KCF", 720)[0] < bright_beyond(long, 720)[0]
    height, end = bright_beyond(long, 400)
    assert end < bright_beyond(long + "_tuned", 400)[1]  # both are written in full
    assert bright_beyond(long + 20 * "_tuned", 400) == (height, pytest.approx(380, abs=20))


def test_an_inset_magnifies_a_small_target() -> None:
    image = np.zeros((720, 1280, 3), np.uint8)
    image[500:510, 300:310] = 255
    scene = Scene(0, {"": image}, np.array([300.0, 500, 10, 10]))
    with_inset = video_frame(scene, {}, (1280, 720))
    without = video_frame(scene, {}, (1280, 720), inset=False)
    corner = np.s_[10:250, 1020:1270]
    assert without[corner].max() == 0
    assert (with_inset[corner] > 200).sum() > 20 * 100
