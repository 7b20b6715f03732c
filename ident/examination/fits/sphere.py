"""Where on the sphere gravity leaves least of the torques."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ident.examination.fits.bodies import RIDGE, Parts

DIRECTIONS, STARTS = 120, 4  # that are tried, and from which it is sought
NEAR = 25.0  # degrees, in which a direction has all of its neighbours


def sought(parts: Parts, error: np.ndarray, size: float) -> list[np.ndarray]:
    """Some gravities (3,) of a size at which less is left than about them, best first; error (C,): what is
    left of the torques, by which they count. (Of one run of a dual arm all began about the best one, and that
    was told, 60 degrees off: another was hardly worse, and right.)"""
    left = _coarse(parts, error)
    directions = _sphere(DIRECTIONS)
    values = np.array([left(size * d) for d in directions])
    near = directions @ directions.T > np.cos(np.radians(NEAR))
    least = np.flatnonzero(values <= np.where(near, values, np.inf).min(axis=1)).tolist()
    starts = sorted(least, key=lambda k: values[k])[:STARTS]
    return sorted((_descended(left, size * directions[k], size) for k in starts), key=left)


def _coarse(parts: Parts, error: np.ndarray) -> Callable[[np.ndarray], float]:
    """Sum of squares over all channels, each by what the plain fit leaves of it, as a function of gravity.
    The columns that no gravity moves (inertias, friction) are taken off the others once."""
    scale = np.where(parts.yy > 0, 1 / np.maximum(parts.yy * np.fmax(error, 0.05), 1e-300), 0.0)
    K = parts.G[0].shape[0]
    G, v = np.zeros((K, K, parts.p, parts.p)), np.zeros((K, parts.p))
    for c, live in enumerate(parts.columns):
        G[:, :, live[:, None], live] += scale[c] * parts.G[c]
        v[:, live] += scale[c] * parts.v[c]
    moved = G[1:, 1:].any(axis=(0, 1, 2))
    size, own = _lengths(G[0, 0].diagonal()[~moved])
    still = G[0, 0][~moved][:, ~moved] / np.outer(size, size) + np.diag(own)
    across = G[:, 0, moved][:, :, ~moved] / size  # (K, m, p - m)
    beside = np.vstack([*across, v[0, ~moved] / size])  # (K m + 1, p - m)
    m, off = int(moved.sum()), beside @ np.linalg.solve(still, beside.T)
    left_G = G[:, :, moved][..., moved] - off[:-1, :-1].reshape(K, m, K, m).swapaxes(1, 2)
    left_v, total = v[:, moved] - off[:-1, -1].reshape(K, m), float(scale @ parts.yy - off[-1, -1])
    i, j = np.triu_indices(K)
    both = np.where(i == j, 0.5, 1.0)[:, None, None]
    squares = (both * (G[i, j] + G[j, i])).diagonal(axis1=1, axis2=2)[:, moved]
    flat = (both * (left_G[i, j] + left_G[j, i])).reshape(len(i), -1)

    def left(g: np.ndarray) -> float:
        factor = np.concatenate([[1.0], g])
        pairs = factor[i] * factor[j]
        length, own = _lengths(pairs @ squares)
        normal = (pairs @ flat).reshape(m, m) / length / length[:, None]
        normal.ravel()[:: m + 1] += own
        right = factor @ left_v / length
        return total - float(right @ np.linalg.solve(normal, right))

    return left


def _lengths(squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of columns, and what stands on the diagonal of their scaled product: a ridge, 1 where nothing is."""
    length = np.sqrt(np.maximum(squares, 1e-300))
    return length, RIDGE + (length <= 1e-140)


def _descended(left: Callable[[np.ndarray], float], g: np.ndarray, size: float) -> np.ndarray:
    """The lowest point of the sphere near g, by a pattern search."""
    value, step = left(g), 0.12 * size
    while step > 0.004 * size:
        u, w = across(g).T
        tries = [g + step * d for d in (u, -u, w, -w, u + w, u - w, -u + w, -u - w)]
        tries = [size * x / np.linalg.norm(x) for x in tries]
        values = [left(x) for x in tries]
        k = int(np.argmin(values))
        if values[k] < value:
            g, value = tries[k], values[k]
        else:
            step /= 2
    return g


def across(g: np.ndarray) -> np.ndarray:
    """(3, 2) directions across a vector (3,)."""
    u = np.cross(g, np.eye(3)[int(np.argmin(np.abs(g)))])
    u = u / np.linalg.norm(u)
    return np.column_stack([u, np.cross(g, u) / np.linalg.norm(g)])


def degrees_between(a: np.ndarray, b: np.ndarray) -> float:
    """Of two vectors; 90 where one is zero."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / size if size else 0.0, -1, 1))))


def _sphere(count: int) -> np.ndarray:
    """(count + 6, 3) directions: a Fibonacci lattice and the six axes."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z * z)
    return np.vstack([np.column_stack([r * np.cos(turn), r * np.sin(turn), z]), np.eye(3), -np.eye(3)])
