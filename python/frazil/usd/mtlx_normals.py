"""Normals of MaterialX's nodes, in tangent space: z along the surface's own, x where s grows, y where t grows.

Model: MaterialX's normalmap, heighttonormal and bump: slopes are those of the height over st, times scale / 16, so that
they do not depend on an object's size.
Not: normal maps in object space.
"""

from __future__ import annotations

import numpy as np

from .expression import Expression, bake
from .mtlx_arithmetic import input_of, number_of, value_of

_SOBEL_SCALE = 1.0 / 16.0  # of MaterialX's heighttonormal


def normalmap(reader, node, output) -> Expression | None:
    """An image of encoded normals."""
    fed = node.input("in")
    value = (Expression.constant((0.5, 0.5, 1.0)) if fed is None else fed).widened(3)
    space = str(value_of(node, "space", "tangent"))
    if space != "tangent":
        reader.context.warn(node.path, f"normal maps must be in tangent space, got '{space}'. It is left out.")
        return None
    strength = np.resize(np.asarray(value_of(node, "scale", 1.0), np.float64), 2)
    factors = np.array([strength[0], strength[1], 1.0])
    return value.affine(2.0 * factors, -1.0 * factors)


def heighttonormal(reader, node, output) -> Expression | None:
    """Encoded normals of a height."""
    return _height_to_normal(input_of(node, "in"), number_of(node, "scale", 1.0), reader, node)


def bump(reader, node, output) -> Expression | None:
    """Normals of a height."""
    height = input_of(node, "height")
    return _height_to_normal(height, number_of(node, "scale", 1.0), reader, node).affine(2.0, -1.0)


def _height_to_normal(value: Expression, scale: float, reader, node) -> Expression:
    if value.image is None:
        return Expression.constant((0.5, 0.5, 1.0))
    placed = np.reshape(value.placement.matrix, (2, 2))  # slopes are over the mesh's st, not the image's

    def normals(height: np.ndarray) -> np.ndarray:
        h = height[..., 0]
        if min(h.shape) < 2:
            n = np.zeros((*h.shape, 3))
            n[..., 2] = 1.0
            return n * 0.5 + 0.5
        by_row, by_column = np.gradient(h)
        over_image = np.stack([by_column * h.shape[1], -by_row * h.shape[0]], axis=-1)  # rows go down, t goes up
        slope = over_image @ placed.T * (scale * _SOBEL_SCALE)
        n = np.concatenate([-slope, np.ones_like(h)[..., None]], axis=-1)
        return n / np.linalg.norm(n, axis=-1, keepdims=True) * 0.5 + 0.5

    key = f"heighttonormal {scale} {value.placement.matrix}"
    return bake([value.component(0)], normals, key, reader.context, node.path)
