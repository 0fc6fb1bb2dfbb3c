"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

from ._frazil import Mesh

__all__ = ["Mesh"]
