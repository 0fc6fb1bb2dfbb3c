"""Portals: a dome's light through a window, the same picture with and without them, and what stages say of them."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from pxr import Gf, UsdGeom, UsdLux
from small_scenes import placed
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.content import content_hash

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
WINDOW = (0.5, 0.4)  # half width and height, in the wall at x = -2


def walls() -> fz.Mesh:
    """Of a room of 4 m, but for the one at x = -2."""
    box = trimesh.creation.box((4.0,) * 3)
    sides = box.faces[box.face_normals[:, 0] > -0.5]
    return fz.Mesh(np.asarray(box.vertices, np.float32), np.asarray(sides, np.int32))


def wall_with_a_window() -> fz.Mesh:
    """In the plane x = -2, 4 x 4 m about (0, 0)."""
    w, h = WINDOW
    y, z = [-2.0, -h, h, 2.0], [-2.0, -w, w, 2.0]
    corners = np.array([[-2.0, a, b] for a in y for b in z], np.float32)
    quads = [4 * i + j for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    triangles = [t for q in quads for t in ((q, q + 1, q + 5), (q, q + 5, q + 4))]
    return fz.Mesh(corners, np.array(triangles, np.int32))


def room(portals: list[np.ndarray], image: bool) -> fz.Scene:
    """A closed room of 4 m with a window, a ball of ice in it."""
    scene = fz.Scene()
    grey = scene.add_material("/grey", fz.StandardMaterial(diffuse_color=(0.6,) * 3))
    scene.add_object("/walls", scene.add_mesh(walls(), "/walls"), grey, placed())
    scene.add_object("/wall", scene.add_mesh(wall_with_a_window(), "/wall"), grey, placed())
    ball = trimesh.creation.icosphere(3, 0.7)
    ice = fz.IceMaterial(fz.Medium(sigma_s_prime=(8.0,) * 3, sigma_a=(0.3,) * 3), refraction=0.0)
    mesh = fz.Mesh(np.asarray(ball.vertices, np.float32), np.asarray(ball.faces, np.int32))
    scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), scene.add_material("/ice", ice), placed(0.3, -1.2, 0))
    sky = None
    if image:
        sky = np.full((16, 32, 3), 0.5, np.float32)
        sky[:8] = 2.0  # the upper half
    scene.add_light(fz.Light(fz.DomeLight(sky, "/sky", portals), path="/sky"))
    scene.camera = fz.Camera(matrix=placed(0, 0, 1.9), focal_length=14)
    return scene


def window_portal() -> np.ndarray:
    """The window's rectangle; its -z points into the room, at +x."""
    w, h = WINDOW
    matrix = np.eye(4)
    matrix[:3, :3] = [[0, 0, 2 * w], [0, 2 * h, 0], [-1, 0, 0]]
    matrix[3, :3] = (-2.0, 0.0, 0.0)
    return matrix


@pytest.mark.parametrize("image", [False, True])
def test_a_room_is_the_same_with_a_portal_and_less_noisy(image):
    def render(portals, samples):
        options = {"resolution": (32, 18), "max_bounces": 1, "bake_bounces": 0, "spacing": 0.1, "bake_samples": 1024}
        return fz.render(room(portals, image), samples=samples, **options)

    plain, guided = render([], 4096), render([window_portal()], 64)
    for layer in ("diffuse", "translucency"):
        a, b = (film[layer].mean() for film in (plain, guided))
        assert b == pytest.approx(a, rel=0.03), layer
    # In blocks: a pixel of the plain picture meets the window too seldom to know its own variance.
    layers = ("diffuse", "specular")
    a, b = (in_blocks(sum(film[layer] for layer in layers) @ LUMINANCE) for film in (plain, guided))
    variances = [film["variance"][:, :, 0] for film in (plain, guided)]
    z = (a - b) / np.sqrt(sum(in_blocks(v) for v in variances))
    assert np.sqrt(np.mean(z**2)) < 1.6
    # By sample, where no edge of the window is seen: the guided picture has a 64th of the samples.
    indoors = (plain["background"] + guided["background"])[:, :, 0] == 0
    assert np.mean(variances[1][indoors]) / 64 < 0.02 * np.mean(variances[0][indoors])


def in_blocks(picture: np.ndarray) -> np.ndarray:
    """Sums over blocks of 8 x 6 pixels."""
    height, width = picture.shape
    return picture.reshape(height // 6, 6, width // 8, 8).sum(axis=(1, 3))


def bake_noise(portals: list[np.ndarray]) -> float:
    """Relative RMS of what 64 samples give places on the floor, against 16,384."""
    scene = fz.RayScene([walls(), wall_with_a_window()])
    x, z = np.meshgrid(np.linspace(-1.5, 1.5, 12), np.linspace(-1.5, 1.5, 12))
    floor = np.stack([x.ravel(), np.full(x.size, -1.9), z.ravel()], axis=1).astype(np.float32)
    places = SimpleNamespace(positions=floor, normals=np.tile(np.float32([-0.8, 0.6, 0.0]), (len(floor), 1)))
    sky = np.ones((16, 32, 3), np.float32)
    sky[8:] = 0.2
    truth, noisy = (
        fz.bake_irradiance(places, scene, [fz.Light(fz.DomeLight(sky, "/sky", p), path="/sky")], eta=1.0, samples=n)
        for p, n in (([window_portal()], 16384), (portals, 64))
    )
    return float(np.sqrt(np.mean((noisy - truth) ** 2)) / truth.mean())


def test_a_bake_is_less_noisy_with_a_portal():
    with_portal, without = bake_noise([window_portal()]), bake_noise([])
    assert with_portal < 0.25 * without


@pytest.fixture
def stage(tmp_path):
    stage = new_stage(tmp_path / "s.usda", up="Z", meters_per_unit=0.01)
    add_quad(stage, "/Quad")
    return stage


def add_portal(stage, path="/Portal"):
    portal = UsdLux.PortalLight.Define(stage, path)
    portal.CreateWidthAttr(200)
    portal.CreateHeightAttr(50)
    portal.AddTranslateOp().Set(Gf.Vec3d(100, 0, 300))
    return portal


def dome_of(scene):
    (light,) = scene.lights
    return light.shape


def test_portals_of_a_stage_are_read_in_metres_and_turned_up(stage):
    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/Dome"))
    add_portal(stage)
    dome.AddRotateYOp().Set(70.0)  # of the sky alone
    dome.CreatePortalsRel().AddTarget("/Portal")
    scene = load(stage)
    assert scene.warnings == []
    (portal,) = dome_of(scene).portals
    np.testing.assert_allclose(portal[3, :3], (1, 3, 0), atol=1e-6)
    np.testing.assert_allclose(portal[0, :3], (2, 0, 0), atol=1e-6)
    np.testing.assert_allclose(portal[1, :3], (0, 0, -0.5), atol=1e-6)
    assert portal[2, 1] > 0  # light goes down, as along -z of the stage


def test_portals_in_an_instance_move_with_it(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    stage.RemovePrim("/Dome")
    add_quad(stage, "/Quad")
    UsdGeom.Xform.Define(stage, "/Rig")
    UsdLux.DomeLight.Define(stage, "/Rig/Sky").CreatePortalsRel().AddTarget("/Rig/Portal")
    UsdLux.PortalLight.Define(stage, "/Rig/Portal").AddTranslateOp().Set(Gf.Vec3d(1, 2, 3))
    stage.GetPrimAtPath("/Rig").SetActive(False)
    placed_rig = UsdGeom.Xform.Define(stage, "/Placed")
    placed_rig.AddTranslateOp().Set(Gf.Vec3d(10, 0, 0))
    placed_rig.GetPrim().GetReferences().AddInternalReference("/Rig")
    placed_rig.GetPrim().SetInstanceable(True)
    placed_rig.GetPrim().SetActive(True)
    scene = load(stage)
    assert scene.warnings == []
    (portal,) = dome_of(scene).portals
    np.testing.assert_allclose(portal[3, :3], (11, 2, 3), atol=1e-6)


@pytest.mark.parametrize("problem", ["none", "no portal", "flat", "hidden"])
def test_portals_that_guide_nothing(stage, problem):
    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/Dome"))
    portal = add_portal(stage)
    if problem == "none":
        expected = "/Portal: a portal guides the light of a dome"
    elif problem == "no portal":
        dome.CreatePortalsRel().SetTargets(["/Portal", "/Quad"])
        expected = "/Dome: portals must be PortalLight prims, got /Quad"
    elif problem == "flat":
        dome.CreatePortalsRel().AddTarget("/Portal")
        portal.GetWidthAttr().Set(0.0)
        expected = "/Portal: width, height and scale must be > 0"
    else:
        dome.CreatePortalsRel().AddTarget("/Portal")
        UsdGeom.Imageable(portal).MakeInvisible()
        expected = None
    scene = load(stage)
    assert len(dome_of(scene).portals) == (problem == "no portal")
    assert [w[: len(expected)] for w in scene.warnings] == [expected] if expected else not scene.warnings


def test_a_portal_is_refused_that_is_flat():
    place = SimpleNamespace(positions=np.zeros((1, 3), np.float32), normals=np.float32([[0, 1, 0]]))
    dome = fz.Light(fz.DomeLight(None, "/sky", [np.diag([0.0, 1, 1, 1])]), path="/sky")
    with pytest.raises(ValueError, match="/sky: portals must be invertible"):
        fz.bake_irradiance(place, fz.RayScene([]), [dome])


def test_a_portal_that_moves_is_other_content():
    moved = window_portal()
    moved[3, 1] = 0.1
    domes = [
        fz.Light(fz.DomeLight(None, "/sky", portals)) for portals in ([window_portal()], [window_portal()], [moved], [])
    ]
    first, same, *others = map(content_hash, domes)
    assert first == same
    assert first not in others
