"""What every part of the reader needs: the stage, the time, the units, and where warnings go."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from ..warning import FrazilWarning

# (x, y, z) of a Z-up stage becomes (x, z, -y): a turn by -90 degrees about x, for row vectors.
_Z_UP_TO_Y_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


@dataclass
class ReadContext:
    """The stage at one time, and what was said about it."""

    stage: Usd.Stage
    file: str
    time: Usd.TimeCode
    purposes: frozenset[str]
    subdivision_level: int
    rest_time: Usd.TimeCode | None = None  # of meshes whose points move and that have no rest primvar
    warnings: list[str] = field(default_factory=list)
    temporary_files: dict[str, Path] = field(default_factory=dict)
    layers: list[Sdf.Layer] = field(default_factory=list)  # made here, and kept alive
    _said: set[tuple[str, str]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._warn_of_units_below()
        self.meters_per_unit = UsdGeom.GetStageMetersPerUnit(self.stage)
        if not (np.isfinite(self.meters_per_unit) and self.meters_per_unit > 0):
            self.warn(self.file, f"metersPerUnit must be > 0, got {self.meters_per_unit}. Taken as 1.")
            self.meters_per_unit = 1.0
        self.is_z_up = UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z
        turn = _Z_UP_TO_Y_UP if self.is_z_up else np.eye(4)
        self.stage_to_world = turn @ np.diag([self.meters_per_unit] * 3 + [1.0])
        self.transforms = UsdGeom.XformCache(self.time)

    def _warn_of_units_below(self) -> None:
        # USD takes what holds for a whole stage from its root layer alone.
        root, *below = self.stage.GetLayerStack(includeSessionLayers=False)
        for key, taken in (
            ("metersPerUnit", UsdGeom.GetStageMetersPerUnit(self.stage)),
            ("upAxis", UsdGeom.GetStageUpAxis(self.stage)),
        ):
            values = [layer.pseudoRoot.GetInfo(key) for layer in below if layer.pseudoRoot.HasInfo(key)]
            if values and values[0] != taken and not root.pseudoRoot.HasInfo(key):
                self.warn(
                    self.file,
                    f"{key} must be authored in the root layer, got {values[0]} in a sublayer alone. Taken as {taken}, "
                    "as USD has it.",
                )

    def warn(self, path: Sdf.Path | str, message: str, once: str = "") -> None:
        """Warn about one prim; with `once`, the same prim and key are named only the first time."""
        key = (str(path), once or message)
        if key in self._said:
            return
        self._said.add(key)
        text = f"{path}: {message}"
        self.warnings.append(text)
        warnings.warn(text, FrazilWarning, stacklevel=2)

    def local_to_world(self, prim: Usd.Prim) -> np.ndarray:
        """The prim's frame to Frazil's world: (4, 4) for row vectors, metres, +y up."""
        return to_array(self.transforms.GetLocalToWorldTransform(prim)) @ self.stage_to_world

    def get(self, attribute: Usd.Attribute, default=None):
        """The attribute's value at the frame, or `default` where it has none."""
        if not attribute:
            return default
        value = attribute.Get(self.time)
        return default if value is None else value


def to_array(matrix: Gf.Matrix4d) -> np.ndarray:
    """A USD matrix as (4, 4) float64."""
    return np.array(matrix, dtype=np.float64)


def are_singular(matrices: np.ndarray) -> np.ndarray:
    """Which transforms (N, 4, 4) cannot be used: not finite, or flat, also in the core's single precision."""
    with np.errstate(all="ignore"):
        is_finite = np.isfinite(matrices.astype(np.float32)).all(axis=(1, 2))
        linear = np.where(is_finite[:, None, None], matrices[:, :3, :3], 0.0)
        volume = np.abs(np.linalg.det(linear))
        box = np.prod(np.linalg.norm(linear, axis=2), axis=1)
        return ~is_finite | ~((volume > 1e-9 * box) & (volume > 1e-36) & (volume < 1e36))


def is_singular(matrix: np.ndarray) -> bool:
    """Whether one transform (4, 4) cannot be used; see are_singular."""
    return bool(are_singular(matrix[None])[0])
