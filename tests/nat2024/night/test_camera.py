import numpy as np
import pytest

from nat2024.night.camera import Camera, pulse, sway


def test_straight_down_is_a_map_with_the_view_upwards():
    camera = Camera(
        (0.0, 0.0, 50.0), yaw=0.0, pitch=np.pi / 2, roll=0.0, focal=500, size=(640, 360)
    )
    points = np.array([[0, 0, 0], [5, 0, 0], [0, 5, 0], [5, 0, 25.0]])
    pixels, depth = camera.project(points)
    assert pixels == pytest.approx(np.array([[320, 180], [370, 180], [320, 130], [420, 180]]))
    assert depth == pytest.approx([50, 50, 50, 25])


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("roll", [0.0, 0.1])
def test_the_ground_ahead_is_in_the_middle_and_axes_are_a_rotation(yaw, roll):
    camera = Camera((3.0, -2.0, 30.0), yaw, pitch=0.7, roll=roll, focal=400, size=(320, 180))
    ahead = 30 / np.tan(0.7)
    spot = np.array([[3 + ahead * np.sin(yaw), -2 + ahead * np.cos(yaw), 0]])
    assert camera.project(spot)[0][0] == pytest.approx([160, 90])
    assert camera.axes() @ camera.axes().T == pytest.approx(np.eye(3))
    assert np.linalg.det(camera.axes()) == pytest.approx(1)


def test_the_homography_of_the_ground_is_the_projection_at_height_zero():
    camera = Camera((1.0, 2.0, 20.0), 0.4, 0.9, 0.02, 300, (320, 180))
    spots = np.random.default_rng(0).uniform(0, 20, size=(20, 2))
    flat = np.column_stack([spots, np.ones(20)]) @ camera.ground().T
    pixels, _ = camera.project(np.column_stack([spots, np.zeros(20)]))
    assert flat[:, :2] / flat[:, 2:] == pytest.approx(pixels)


def test_sway_is_smooth_and_a_pulse_comes_back():
    wave = sway(np.random.default_rng(1), 200, 1.0, 0.1)
    assert np.abs(np.diff(wave)).max() < 0.15
    bump = pulse(100, 50, 30)
    assert bump[50] == 1
    assert bump[[0, 99]].max() < 1e-6
