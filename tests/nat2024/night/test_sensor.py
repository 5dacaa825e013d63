from dataclasses import replace

import numpy as np
import pytest

from nat2024.night.sensor import Development, Sensor, add_glow, draw_sensor, expose, tone

PLAIN = Sensor(glow=0.0, grain=0.0, softness=0.0, toe=0.0)


def test_tone_rises_from_the_black_level_to_white():
    light = np.linspace(0, 3, 500, dtype=np.float32)
    grey = tone(light, PLAIN)
    assert (np.diff(grey) >= 0).all()
    assert grey[0] == pytest.approx(PLAIN.black)
    assert grey[-1] == pytest.approx(1)


def test_exposure_meets_the_mean_that_is_asked_for():
    light = np.random.default_rng(0).gamma(0.5, 2.0, size=(40, 60, 3)).astype(np.float32)
    exposed = expose(PLAIN, [light], 0.08)
    assert tone(light * np.float32(exposed.gain), exposed).mean() == pytest.approx(0.08, abs=1e-4)


@pytest.mark.parametrize("level", [0.0, 0.002, 0.02, 0.3])
def test_noise_has_the_variance_of_shot_and_read_noise(level):
    sensor = replace(PLAIN, shot=4e-5, read=4e-4, power=2.2)
    light = np.full((120, 160, 3), level, dtype=np.float32)
    image = Development(sensor, (160, 120), 3).develop(light, 0).astype(float) / 255
    back = ((image - sensor.black) / (1 - sensor.black)).clip(0) ** sensor.power
    expected = np.sqrt(sensor.shot * level + sensor.read**2)
    if level == 0.0:
        expected *= 0.58  # of a normal distribution that is cut at 0
    assert back.mean() == pytest.approx(level, abs=0.75 * expected + 2e-5)
    assert back.std() == pytest.approx(expected, rel=0.15)


def test_a_frame_is_the_same_whatever_was_developed_before():
    light = np.random.default_rng(0).random((64, 96, 3), dtype=np.float32) * 0.1
    before = light.copy()
    one, other = (Development(draw_sensor(np.random.default_rng(1)), (96, 64), 5) for _ in range(2))
    other.develop(light, 0)
    assert np.array_equal(one.develop(light, 7), other.develop(light, 7))
    assert not np.array_equal(one.develop(light, 7), one.develop(light, 8))
    assert not np.array_equal(
        one.develop(light, 7), Development(one.sensor, (96, 64), 6).develop(light, 7)
    )
    assert np.array_equal(light, before)


def test_glow_spreads_light_and_keeps_its_sum():
    light = np.zeros((160, 320, 3), dtype=np.float32)
    light[80, 160] = 100
    glowing = add_glow(light, 0.1)
    assert glowing[80, 160, 0] == pytest.approx(90, rel=0.02)
    assert glowing[80, 170].min() > 0
    assert glowing.sum() == pytest.approx(light.sum(), rel=0.02)
