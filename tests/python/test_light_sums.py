"""Lights of a stage against sums over their surfaces in double precision: any transform, normalize, shaping, images."""

from types import SimpleNamespace

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, UsdGeom, UsdLux
from test_usd_materials import write_image
from usd_stages import add_quad, load, new_stage

import frazil as fz

COUNT = 240  # places along each parameter of a surface
PLACES = np.array([[0, 0, 0], [0.8, -0.5, 0], [-1.2, 0.7, 0.2], [0.3, 1.6, -0.4]])
NORMALS = np.array([[0, 0, 1], [0.3, 0, 0.95], [0, -0.2, 0.98], [0.1, -0.5, 0.86]])
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)
SIZES = {
    "RectLight": {"width": 1.4, "height": 0.8},
    "DiskLight": {"radius": 0.7},
    "SphereLight": {"radius": 0.5},
    "CylinderLight": {"length": 1.6, "radius": 0.3},
}


def transforms() -> dict[str, np.ndarray]:
    turn = np.array(Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0.3, 0.2), 25)))
    turn[3, :3] = (0.2, 0.1, 2.5)
    sheared = np.diag([1.7, 0.6, 2.2, 1.0])
    sheared[1, 0], sheared[2, 1], sheared[2, 0] = 0.3, -0.9, 0.5
    return {"turned": turn, "sheared": sheared @ turn, "mirrored": np.diag([-1.0, 1, 1, 1]) @ sheared @ turn}


def surface(kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, both tangents by parameter, and what to normals must point along, in the light's frame."""
    x = (np.arange(COUNT) + 0.5) / COUNT
    u, v = np.meshgrid(x, x, indexing="ij")
    zero, size = np.zeros_like(u), SIZES[kind]
    c, s = np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)

    def stack(*rows):
        return np.stack(np.broadcast_arrays(*rows), axis=-1)

    if kind == "RectLight":
        w, h = size["width"], size["height"]
        return (
            stack((u - 0.5) * w, (v - 0.5) * h, zero),
            stack(w + zero, 0, 0),
            stack(0, h + zero, 0),
            stack(0, 0, zero - 1),
        )
    r = size["radius"]
    if kind == "DiskLight":
        along = stack(c, s, zero)
        return r * u[..., None] * along, r * along, 2 * np.pi * r * stack(-u * s, u * c, 0), stack(0, 0, zero - 1)
    if kind == "SphereLight":
        a, b = np.cos(np.pi * u), np.sin(np.pi * u)
        places = r * stack(b * c, a, b * s)
        return places, np.pi * r * stack(a * c, -b, a * s), 2 * np.pi * r * stack(-b * s, zero, b * c), places
    length = size["length"]
    round_about = stack(zero, c, s)
    axis = stack((u - 0.5) * length, 0, 0)
    return axis + r * round_about, stack(length + zero, 0, 0), 2 * np.pi * r * stack(0, -s, c), round_about


def shaped(shaping: dict, matrix: np.ndarray, direction: np.ndarray) -> np.ndarray | float:
    """UsdLuxShapingAPI, for light that travels along `direction`."""
    if not shaping:
        return 1.0
    cosine = direction @ (-matrix[2, :3] / np.linalg.norm(matrix[2, :3]))
    begin = shaping["angle"] * (1 - shaping["softness"])
    t = np.clip((np.degrees(np.arccos(np.clip(cosine, -1, 1))) - begin) / (shaping["angle"] - begin), 0, 1)
    tint = np.array(shaping["tint"])
    return (1 - t * t * (3 - 2 * t))[..., None] * (tint + (1 - tint) * (np.abs(cosine) ** shaping["focus"])[..., None])


def bilinear(image: np.ndarray) -> np.ndarray:
    """The image over the rect: upright as seen from the side that shines, where +x lies to the left."""
    height, width = image.shape[:2]
    x = (1 - (np.arange(COUNT) + 0.5) / COUNT) * width - 0.5
    y = (1 - (np.arange(COUNT) + 0.5) / COUNT) * height - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[:, None, None], (y - y0)[None, :, None]

    def at(i, j):
        return image[np.clip(j, 0, height - 1)[None, :], np.clip(i, 0, width - 1)[:, None]]

    return (at(x0, y0) * (1 - fx) + at(x0 + 1, y0) * fx) * (1 - fy) + (
        at(x0, y0 + 1) * (1 - fx) + at(x0 + 1, y0 + 1) * fx
    ) * fy


def summed(kind: str, matrix: np.ndarray, normalize: bool, shaping: dict, image: np.ndarray | None) -> np.ndarray:
    """Irradiance (4, 3) at the places."""
    local, du, dv, outwards = surface(kind)
    linear = matrix[:3, :3]
    flow = np.cross(du @ linear, dv @ linear) / COUNT**2
    flow *= np.sign((flow * (outwards @ linear)).sum(axis=-1, keepdims=True))
    area = np.linalg.norm(flow, axis=-1).sum()
    radiance = 6.0 * np.array([1, 0.5, 0.25]) / (area if normalize else 1.0)
    result = []
    for place, normal in zip(PLACES, NORMALS, strict=True):
        direction = place - (local @ linear + matrix[3, :3])
        distance = np.linalg.norm(direction, axis=-1, keepdims=True)
        direction /= distance
        arriving = np.maximum((flow * direction).sum(axis=-1), 0) * np.maximum(-(direction @ normal), 0)
        factor = shaped(shaping, matrix, direction) * (1.0 if image is None else bilinear(image))
        result.append(((arriving[..., None] / distance**2) * factor).sum(axis=(0, 1)) * radiance)
    return np.array(result)


SHAPED = {"angle": 60.0, "softness": 0.3, "focus": 2.0, "tint": (0.5, 0.1, 0.0)}


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize(
    ("transform", "normalize", "shaping"),
    [("turned", False, SHAPED), ("sheared", True, {}), ("sheared", False, SHAPED), ("mirrored", True, SHAPED)],
)
def test_irradiance_is_the_sum_over_the_surface(tmp_path, kind, transform, normalize, shaping):
    check(tmp_path, kind, transforms()[transform], normalize, shaping, None)


@pytest.mark.parametrize("transform", ["turned", "sheared", "mirrored"])
def test_a_rect_shows_its_image_whatever_its_transform(tmp_path, transform):
    image = (np.random.default_rng(1).random((3, 5, 3)) ** 3 * 4).astype(np.float32)
    check(tmp_path, "RectLight", transforms()[transform], True, SHAPED, image)


def check(tmp_path, kind, matrix, normalize, shaping, image):
    stage = new_stage(tmp_path / "s.usda")
    stage.RemovePrim("/Dome")
    add_quad(stage, "/Quad")
    UsdGeom.Xform.Define(stage, "/Rig").AddTransformOp().Set(Gf.Matrix4d(matrix.tolist()))
    prim = stage.DefinePrim("/Rig/Light", kind)
    for name, size in SIZES[kind].items():
        prim.GetAttribute(f"inputs:{name}").Set(size)
    light = UsdLux.LightAPI(prim)
    light.CreateIntensityAttr(3.0)
    light.CreateExposureAttr(1.0)
    light.CreateColorAttr(Gf.Vec3f(1, 0.5, 0.25))
    light.CreateNormalizeAttr(normalize)
    if shaping:
        api = UsdLux.ShapingAPI.Apply(prim)
        api.CreateShapingConeAngleAttr(shaping["angle"])
        api.CreateShapingConeSoftnessAttr(shaping["softness"])
        api.CreateShapingFocusAttr(shaping["focus"])
        api.CreateShapingFocusTintAttr(Gf.Vec3f(*shaping["tint"]))
    if image is not None:
        write_image(tmp_path / "image.exr", image, oiio.FLOAT)
        prim.GetAttribute("inputs:texture:file").Set(str(tmp_path / "image.exr"))
    scene = load(stage)
    assert scene.warnings == []
    places = SimpleNamespace(positions=PLACES.astype(np.float32), normals=NORMALS.astype(np.float32))
    baked = fz.bake_irradiance(places, fz.RayScene([]), scene.lights, eta=1.0, samples=4096)[:, 0]
    expected = summed(kind, matrix, normalize, shaping, image)
    np.testing.assert_allclose(baked, expected, rtol=0.01, atol=2e-3 * expected.max())
