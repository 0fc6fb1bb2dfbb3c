"""A field of formations: a few prototypes, placed hundreds of times as native USD instances on snow.

Model: each prototype is one formation's ice, made once; instances are turned, scaled and strewn so that none stand
    closer than their size (darts, dense in bands as ice gathers). Meshes are shared between instances; light is baked
    for each, since it differs where one stands in another's shadow (docs/formations.md).
Units: metres, y up.
Not: animation; rocks on every instance.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom

from .formation import CameraRow, Formation, check_count, check_parameters
from .noise import Noise
from .randomness import generator
from .spires import ice_tips, spire_cluster
from .surroundings import kSnow, sky_and_lights, snowfield
from .usd import add_formation, add_geometry, check_suffix, write_stage

_SPACING = 3.4  # metres between neighbours


@dataclass
class Field:
    """Ground, lights and camera; prototypes; of each instance which it is (N,), and its x, z, turn and size (N, 4)."""

    ground: Formation
    prototypes: list[Formation]
    which: np.ndarray
    places: np.ndarray


def ice_field(
    count: int = 500, prototypes: int = 5, seed: int = 0, triangles: int = 60_000, spacing: float = 0.0
) -> Field:
    """A field of `count` instances of `prototypes` formations.

    Parameters
    ----------
    count : int
        Instances, 1 to 20,000.
    prototypes : int
        Different ones, 1 to 50; clusters of spires and rows of tips in turn.
    seed : int
        Another number, another field.
    triangles : int
        Of each prototype, 10,000 to 20,000,000.
    spacing : float
        Of the points that translucency is gathered from, in metres on a prototype of full size; 0 = from the material.

    Returns
    -------
    Field
    """
    check_parameters("ice_field", 1.0, 0.0, seed, 1.0, triangles)
    check_count("ice_field", "count", count, 1, 20_000)
    check_count("ice_field", "prototypes", prototypes, 1, 50)
    rng = generator("ice_field", seed)
    made = []
    for k in range(prototypes):
        make = dict(age=float(rng.uniform(0.1, 0.6)), seed=int(rng.integers(2**31)), triangles=triangles)
        one = ice_tips(scale=1.6, **make) if k % 3 == 2 else spire_cluster(scale=3.0, count=14, **make)
        one.name = f"prototype{k}"
        one.parts = [part for part in one.parts if part.collection == "ice"]
        one.materials = {"Ice": one.materials["Ice"]}
        if spacing > 0.0:
            one.materials["Ice"].inputs["spacing"] = float(spacing)
        made.append(one)
    places = _strew(rng, count, Noise(seed))
    extent = float(np.abs(places[:, :2]).max()) + 5.0
    parameters = dict(count=count, prototypes=prototypes, seed=seed, triangles=triangles)
    camera = CameraRow((4.0, 7.0, extent + 9.0), (0.0, 0.0, 0.25 * extent), 30.0)
    ground = Formation("ice_field", parameters, [], {}, [], camera)
    ground.sky, ground.lights = sky_and_lights(seed, (-0.85, 0.30, -0.45), triangles)
    ground.materials = {"Snow": kSnow}
    ground.parts = [snowfield(seed, 2.5, 400_000, -0.12, extent=1.5 * extent)]
    return Field(ground, made, rng.integers(0, prototypes, count), places)


def write_field(field: Field, path: str | Path) -> None:
    """Write the field as USD, its sky beside it; ValueError for another suffix, OSError where it cannot be written."""
    path = Path(path)
    check_suffix(path)
    write_stage(path, lambda stage, sky: _add_field(stage, field, sky), field.ground.sky)


def _add_field(stage: Usd.Stage, field: Field, sky: str) -> None:
    add_formation(stage, field.ground, sky)
    stage.CreateClassPrim("/Prototypes")
    for one in field.prototypes:
        add_geometry(stage, one, f"/Prototypes/{one.name}")
    for k, (which, (x, z, turn, size)) in enumerate(zip(field.which, field.places, strict=True)):
        prim = UsdGeom.Xform.Define(stage, f"/World/Field/Ice{k:05d}")
        prim.GetPrim().GetReferences().AddInternalReference(f"/Prototypes/{field.prototypes[which].name}")
        prim.GetPrim().SetInstanceable(True)
        matrix = Gf.Matrix4d().SetScale(float(size))
        matrix *= Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), float(np.degrees(turn))))
        matrix *= Gf.Matrix4d().SetTranslate(Gf.Vec3d(float(x), 0.0, float(z)))
        prim.AddTransformOp().Set(matrix)


def _strew(rng: np.random.Generator, count: int, noise: Noise) -> np.ndarray:
    # Darts in a disc that grows with the number, fewer where a low noise says that the ice has drifted apart.
    radius = _SPACING * np.sqrt(count) * 0.85
    sizes = np.array([0.6, 0.8, 1.0, 1.25])
    kept = np.empty((0, 4))
    while len(kept) < count:
        for _ in range(40 * count):
            x, z = rng.uniform(-radius, radius, 2)
            size = sizes[rng.integers(len(sizes))]
            turn = rng.uniform(0, 2 * np.pi)
            if np.hypot(x, z) > radius or rng.random() > 0.65 + 0.5 * noise(np.array([[x, 0.0, z]]), 9.0, 1)[0]:
                continue
            if len(kept) and np.hypot(kept[:, 0] - x, kept[:, 1] - z).min() < _SPACING * min(size, 1.0) * 0.8:
                continue
            kept = np.vstack([kept, [x, z, turn, size]])
            if len(kept) == count:
                break
        radius *= 1.15
    return kept
