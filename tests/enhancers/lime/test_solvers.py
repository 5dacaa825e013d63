"""The solvers of LIME against dense ones, and the exact solver against a long run of its own."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from nat2024.testing.enhancers import night_image
from nat2024_enhancers.lime.dissection import FivePoint, solve
from nat2024_enhancers.lime.illumination import (
    Smoothness,
    guess_illumination,
    smoothness_by_texture,
    smoothness_by_window,
)
from nat2024_enhancers.lime.refinement import objective, refine_exactly, refine_quickly


def random_system(count, height, width, seed=0, spread=6.0):
    """Asymmetric links over `spread` powers of ten."""
    random = np.random.Generator(np.random.PCG64(seed))
    up, down, left, right = (
        torch.from_numpy(-(10 ** (random.random((count, height, width)) * spread - 2)))
        for _ in range(4)
    )
    up[:, 0] = down[:, -1] = 0
    left[..., 0] = right[..., -1] = 0
    return FivePoint(1 - up - down - left - right, up, down, left, right)


def dense_of(system):
    _, height, width = system.centre.shape
    size = height * width
    units = torch.eye(size, dtype=torch.float64).view(size, height, width)
    many = FivePoint(*(part.expand(size, -1, -1) for part in system))
    return many.apply(units).flatten(1).T


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 23), st.integers(1, 23), st.integers(0, 1000))
def test_dissection_equals_a_dense_solution(height, width, seed):
    system = random_system(1, height, width, seed)
    chance = torch.Generator().manual_seed(seed)
    target = torch.rand(1, height, width, dtype=torch.float64, generator=chance)
    expected = torch.linalg.solve(dense_of(system), target.flatten()).view(height, width)
    torch.testing.assert_close(solve(system, target)[0], expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("size", [(64, 96), (65, 3), (3, 700), (37, 128), (80, 40)])
def test_dissection_solves_larger_systems_of_a_batch(size):
    system = random_system(2, *size)
    chance = torch.Generator().manual_seed(3)
    target = torch.rand(2, *size, dtype=torch.float64, generator=chance)
    # weights reach millions, and the residual is as exact as their rounding
    torch.testing.assert_close(system.apply(solve(system, target)), target, rtol=0, atol=1e-7)


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (40, 56), (3, 500), (61, 27)])
@pytest.mark.parametrize("eps", [0.001, 0.1])
def test_conjugate_gradients_equal_the_direct_solution(size, eps, monkeypatch):
    from nat2024_enhancers.lime import refinement

    guess = guess_illumination(night_image(*size).transpose(2, 0, 1) / 255, 0.02)
    smoothness = smoothness_by_texture(guess, 2.0, eps)
    quick = refine_quickly(guess, smoothness, 0.15, of_start=True)
    monkeypatch.setattr(refinement, "_solve_by_gradients", lambda *_: None)
    direct = refine_quickly(guess, smoothness, 0.15, of_start=True)
    np.testing.assert_allclose(quick, direct, rtol=0, atol=3e-6)


def test_hard_links_are_solved_directly(monkeypatch):
    guess = guess_illumination(night_image(40, 56).transpose(2, 0, 1) / 255)
    smoothness = smoothness_by_window(guess, 3.0, 0.001)
    assert smoothness.weight_x.max() > 1e6
    monkeypatch.delattr("nat2024_enhancers.lime.refinement._solve_by_gradients")
    t = refine_quickly(guess, smoothness, 0.15, of_start=True)
    # in a symmetric system whose rows sum to 1 the mean is kept
    assert t.mean() == pytest.approx(guess.mean(), abs=1e-6)


def test_the_equations_are_those_of_the_published_form():
    guess = np.array([[0.2, 0.5, 0.9]])
    weights = np.array([[1.0, 2.0, 4.0]])
    smoothness = Smoothness(weights, 0 * weights, weights, 0 * weights)
    of_other = np.array([[1 + 2, -2, 0], [-1, 1 + 1 + 4, -4], [0, -2, 1 + 2]])
    of_start = np.array([[1 + 1, -1, 0], [-1, 1 + 1 + 2, -2], [0, -2, 1 + 2]])
    for flag, matrix in ((False, of_other), (True, of_start)):
        t = refine_quickly(guess, smoothness, 1.0, of_start=flag)
        np.testing.assert_allclose(matrix @ t[0], guess[0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("alpha", [0.15, 0.001])
def test_exact_solver_comes_within_one_per_cent_of_a_long_run(alpha):
    guess = guess_illumination(night_image(48, 64).transpose(2, 0, 1) / 255, 0.02)
    smoothness = smoothness_by_texture(guess, 2.0, 0.001)
    long = refine_exactly(guess, smoothness, alpha, passes=5000)
    usual = refine_exactly(guess, smoothness, alpha)
    reached, least = (objective(t, guess, smoothness, alpha) for t in (usual, long))
    flat = objective(np.full_like(guess, guess.mean()), guess, smoothness, alpha)
    assert least <= min(flat, objective(guess, guess, smoothness, alpha)) * 1.0001
    assert reached <= 1.01 * least


def test_exact_solver_finds_the_minimum_of_two_pixels():
    guess = np.array([[0.2, 0.8]])
    strength = np.array([[0.4, 0.0]])
    smoothness = Smoothness(strength, 0 * strength, strength, 0 * strength)
    # each end moves by alpha W / 2 towards the other
    t = refine_exactly(guess, smoothness, 0.5, passes=2000)
    np.testing.assert_allclose(t, [[0.3, 0.7]], rtol=0, atol=1e-5)
    assert refine_exactly(guess, smoothness, 0.0) is guess
