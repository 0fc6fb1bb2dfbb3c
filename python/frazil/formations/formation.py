"""What a formation is: plain data, which usd.py writes and Python can take apart.

Model: parts (meshes with a material and a collection each), materials (a shader and its inputs), a sky, lights, a
    camera.
Units: metres, y up; radiance with sunlit snow about 1.
Not: a Scene; write it as USD and read it with `fz.load_usd`.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .contour import Surface, corner_normals

kFewest, kMost = 10_000, 20_000_000


@dataclass
class Part:
    """One mesh: positions (V, 3) m, triangles (F, 3) counterclockwise from outside, normals (F, 3, 3) or None (smooth
    over creases below `crease` degrees when written), colours (V, 3) or None; closed unless `is_sheet`."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    material: str
    collection: str
    normals: np.ndarray
    colors: np.ndarray | None = None
    is_sheet: bool = False

    @staticmethod
    def of(name: str, surface: Surface, material: str, collection: str, crease: float = 40.0, **more: Any) -> "Part":
        """A part of a surface, with normals that break at creases sharper than `crease` degrees."""
        return Part(
            name,
            surface.positions.astype(np.float32),
            surface.triangles.astype(np.int32),
            material,
            collection,
            corner_normals(surface, crease).astype(np.float32),
            **more,
        )


@dataclass(frozen=True)
class MaterialRow:
    """A shader (`frazil:ice` or `UsdPreviewSurface`) and its inputs by name; `displayColor` feeds `diffuseColor`."""

    shader: str
    inputs: dict[str, Any] = field(default_factory=dict)
    uses_colors: bool = False


@dataclass(frozen=True)
class LightRow:
    """A UsdLux light: `kind` dome, distant, rect or sphere; `toward` (3,) is where a distant light stands, a rect light
    at `at` looks to `to`; `size` is the width of a rect, the radius of a sphere, the angle in degrees of a distant."""

    name: str
    kind: str
    intensity: float
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    toward: tuple[float, float, float] = (0.0, 1.0, 0.0)
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    to: tuple[float, float, float] = (0.0, 0.0, 0.0)
    size: float = 1.0


@dataclass(frozen=True)
class CameraRow:
    """A perspective camera at `eye` looking to `to`, with a focal length in mm on a film of 36 mm x 20.25 mm."""

    eye: tuple[float, float, float]
    to: tuple[float, float, float]
    focal_mm: float = 35.0


@dataclass
class Formation:
    """A formation: see the module. `sky` is a lat-long image (H, W, 3) for the dome light; None for plain light."""

    name: str
    parameters: dict[str, Any]
    parts: list[Part]
    materials: dict[str, MaterialRow]
    lights: list[LightRow]
    camera: CameraRow
    sky: np.ndarray | None = None

    @property
    def collections(self) -> dict[str, list[str]]:
        """Names of the parts of each collection (ice, rocks, snow, water ...)."""
        found: dict[str, list[str]] = {}
        for part in self.parts:
            found.setdefault(part.collection, []).append(part.name)
        return found

    @property
    def triangle_count(self) -> int:
        return sum(len(part.triangles) for part in self.parts)

    def part(self, name: str) -> Part:
        for part in self.parts:
            if part.name == name:
                return part
        raise KeyError(f"{self.name}: part must be one of {', '.join(p.name for p in self.parts)}, got {name!r}.")

    def scaled(self, factor: float) -> "Formation":
        """The same formation, larger by `factor`: meshes, lengths of the ice, lamps and camera."""

        def longer(v):
            return tuple(factor * x for x in v)

        def resized(row: MaterialRow) -> MaterialRow:
            inputs = dict(row.inputs)
            if row.shader == "frazil:ice":
                for key in ("preset_scale", "spacing"):
                    if key in inputs:
                        inputs[key] = inputs[key] * factor
            return replace(row, inputs=inputs)

        for part in self.parts:
            part.positions = (part.positions * np.float32(factor)).astype(np.float32)
        return replace(
            self,
            materials={name: resized(row) for name, row in self.materials.items()},
            lights=[
                replace(
                    light,
                    at=longer(light.at),
                    to=longer(light.to),
                    size=light.size if light.kind == "distant" else light.size * factor,
                )
                for light in self.lights
            ],
            camera=replace(self.camera, eye=longer(self.camera.eye), to=longer(self.camera.to)),
        )


def check_parameters(name: str, scale: float, age: float, seed: int, detail: float, triangles: int | None) -> None:
    """ValueError where a common parameter is out of range."""

    def refuse(field_name: str, rule: str, value: Any, remedy: str) -> None:
        raise ValueError(f"formations.{name}: {field_name} must be {rule}, got {value}. {remedy}")

    if not (np.isfinite(scale) and 1e-3 <= scale <= 1e6):
        refuse("scale", "from 0.001 to 1e6", scale, "It is a length in metres.")
    if not 0.0 <= age <= 1.0:
        refuse("age", "from 0 (fresh) to 1 (old)", age, "Clamp it.")
    if int(seed) != seed or not 0 <= seed < 2**32:
        refuse("seed", "a whole number from 0 to 4294967295", seed, "Any one gives another formation.")
    if not (np.isfinite(detail) and 0.0 < detail <= 100.0):
        refuse("detail", "above 0 and up to 100", detail, "1 is the default number of triangles.")
    if triangles is not None and not kFewest <= triangles <= kMost:
        refuse("triangles", f"from {kFewest} to {kMost}", triangles, "Choose another number, or detail instead.")


def check_count(name: str, field_name: str, value: int, least: int, most: int) -> None:
    """ValueError where a number of things is out of range."""
    if int(value) != value or not least <= value <= most:
        rule = f"a whole number from {least} to {most}"
        raise ValueError(f"formations.{name}: {field_name} must be {rule}, got {value}. Choose another.")


def check_within(name: str, field_name: str, value: float, least: float, most: float, remedy: str) -> None:
    """ValueError where a parameter of one formation is out of range."""
    if not least <= value <= most:
        raise ValueError(f"formations.{name}: {field_name} must be from {least:g} to {most:g}, got {value}. {remedy}")


def triangle_budget(default: int, detail: float, triangles: int | None) -> int:
    """How many triangles the ice gets: `triangles`, else the default times detail squared, within the limits."""
    return int(triangles) if triangles is not None else int(np.clip(default * detail * detail, kFewest, kMost))
