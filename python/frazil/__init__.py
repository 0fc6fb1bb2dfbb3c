"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

from ._frazil import Mesh, PointSet, poisson_points, tessellated_points

__all__ = ["Mesh", "PointSet", "poisson_points", "tessellated_points"]
