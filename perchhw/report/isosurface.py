"""The surface on which values on a grid are zero, as triangles: marching tetrahedra.

Each cell of the grid is cut into six tetrahedra around its main diagonal; a tetrahedron whose corners differ
in sign holds one triangle or two, with corners where the values, taken as linear along its edges, are zero
(Doi and Koide 1991).
"""

from itertools import permutations

import numpy as np

from onboard.arrays import FloatArray

_CORNERS = np.array(
    [[np.zeros(3, int), np.eye(3, dtype=int)[a], 1 - np.eye(3, dtype=int)[c], np.ones(3, int)]
     for a, _b, c in permutations(range(3))]
)  # fmt: skip
"""(6, 4, 3) offsets of the tetrahedra's corners within a cell."""


def zero_surface(values: FloatArray, axes: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
    """Triangles of the surface between negative and other values.

    Args:
        values: (p, q, r) on the grid.
        axes: coordinates of the grid along each dimension, (p,), (q,), (r,).

    Returns:
        (n, 3, 3): triangle, corner, coordinate.
    """
    cells = np.stack(np.meshgrid(*(np.arange(n - 1) for n in values.shape), indexing="ij"), -1).reshape(-1, 3)
    index = (cells[:, None, None, :] + _CORNERS).reshape(-1, 4, 3)
    heights = values[index[..., 0], index[..., 1], index[..., 2]]
    crossed = (heights < 0.0).any(axis=1) & (heights >= 0.0).any(axis=1)
    index, heights = index[crossed], heights[crossed]
    points = np.stack([axis[index[..., k]] for k, axis in enumerate(axes)], axis=-1)
    order = np.argsort(heights >= 0.0, axis=1, kind="stable")  # negative corners first
    heights = np.take_along_axis(heights, order, axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    negative = (heights < 0.0).sum(axis=1)
    edges = {
        1: [[(0, 1), (0, 2), (0, 3)]],
        2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
        3: [[(0, 3), (1, 3), (2, 3)]],
    }
    found = [
        np.stack(
            [_crossing(points[negative == count], heights[negative == count], *edge) for edge in triangle], 1
        )
        for count, triangles in edges.items()
        for triangle in triangles
    ]
    return np.concatenate(found)


def _crossing(points: FloatArray, heights: FloatArray, a: int, b: int) -> FloatArray:
    """Where the edge from corner a (negative) to corner b (not) is zero, (n, 3)."""
    share = heights[:, a] / (heights[:, a] - heights[:, b])
    crossing: FloatArray = points[:, a] + share[:, None] * (points[:, b] - points[:, a])
    return crossing
