"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

from ._frazil import Mesh, PointSet, PointStatistics, point_statistics, tessellated_points
from .points import poisson_points

__all__ = ["Mesh", "PointSet", "PointStatistics", "point_statistics", "poisson_points", "tessellated_points"]
