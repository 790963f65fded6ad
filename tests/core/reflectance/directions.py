"""Directions of the local frame that tests look along."""

import numpy as np


def towards(cosine, turn=0.7):
    """(3,) unit vector with a cosine to the normal, and an angle about it."""
    flat = np.sqrt(1 - cosine**2)
    return np.array([flat * np.cos(turn), flat * np.sin(turn), cosine])


def hemisphere(n, seed=3):
    """(n, 3) random unit vectors above the horizon."""
    directions = np.random.default_rng(seed).normal(size=(n, 3))
    directions[:, 2] = np.abs(directions[:, 2]) + 1e-3
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def mirror(direction):
    """Where light comes from that a mirror sends along directions (..., 3)."""
    return direction * [-1, -1, 1]
