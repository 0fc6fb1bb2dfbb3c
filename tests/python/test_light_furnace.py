"""What all lights keep together: a furnace of any mix is one picture, twins cancel, occlusion is what is open."""

import warnings

import numpy as np
import pytest
import trimesh
from small_scenes import ice_over_floor, placed

import frazil as fz

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
HALF = 4.0  # of the box of lights around the furnace, metres


def two_balls() -> fz.Scene:
    """A ball of ice and a grey one, with nothing else."""
    scene = fz.Scene()
    ball = trimesh.creation.icosphere(3, 0.9)
    mesh = fz.Mesh(np.asarray(ball.vertices, np.float32), np.asarray(ball.faces, np.int32))
    medium = fz.Medium(sigma_s_prime=(8.0, 9.0, 10.0), sigma_a=(0.6, 0.2, 0.05))
    looks = {"/ice": fz.IceMaterial(medium, refraction=0.0), "/grey": fz.StandardMaterial(diffuse_color=(0.5,) * 3)}
    for x, (path, look) in zip((-1.0, 1.0), looks.items(), strict=True):
        scene.add_object(path, scene.add_mesh(mesh, path), scene.add_material(path, look), placed(x))
    scene.camera = fz.Camera(matrix=placed(0, 0, 3.8), focal_length=25)
    return scene


def inward(axis: int, sign: float) -> np.ndarray:
    """Where a rect stands on the box's side and shines to its middle."""
    z = np.zeros(3)
    z[axis] = sign
    x = np.roll(z, 1)
    matrix = np.eye(4)
    matrix[:4, :3] = [x, np.cross(z, x), z, HALF * z]
    return matrix


def rects(radiance: float, group: str = "", image: bool = False) -> list[fz.Light]:
    white = np.ones((3, 5, 3), np.float32) if image else None
    shape = fz.RectLight(2 * HALF, 2 * HALF, white, "/white")
    return [
        fz.Light(shape, radiance=[radiance] * 3, matrix=inward(axis, sign), path=f"/rect{axis}{sign}", group=group)
        for axis in range(3)
        for sign in (-1.0, 1.0)
    ]


def dome(radiance: float, image: bool = False) -> fz.Light:
    shape = fz.DomeLight(np.ones((8, 16, 3), np.float32), "/sky") if image else fz.DomeLight()
    return fz.Light(shape, radiance=[radiance] * 3, path="/dome")


def distant(radiance: float) -> fz.Light:
    return fz.Light(fz.DistantLight(360.0), radiance=[radiance] * 3, path="/around")


def render(scene: fz.Scene, lights: list[fz.Light], **options) -> fz.Film:
    for light in lights:
        scene.add_light(light)
    settings = {"resolution": (64, 36), "samples": 64, "bake_samples": 256, "bake_bounces": 0, "spacing": 0.1}
    return fz.render(scene, **(settings | options))


def check_same(film: fz.Film, other: fz.Film, layers=("translucency", "diffuse", "specular")) -> None:
    """Equal layers in the mean over each ball, and pixel by pixel within the noise of both."""
    ids, seen = other["object_id"][:, :, 0], film["object_id"][:, :, 0]
    np.testing.assert_array_equal(ids, np.where(seen > 2, 0, seen))
    for index in (1, 2):
        for layer in layers:
            a, b = (f[layer][ids == index].mean() for f in (film, other))
            assert a == pytest.approx(b, rel=0.012, abs=2e-3), (layer, index)
    inside = (other["beauty"][:, :, 3] == 1) & (other["variance"][:, :, 0] > 0)
    a, b = (sum(f[layer] for layer in layers)[inside] @ LUMINANCE for f in (film, other))
    variance = (film["variance"][inside] + other["variance"][inside])[:, 0]
    # A hundredth for the bake, whose noise is not in the variance.
    z = (a - b) / np.sqrt(variance + (0.01 * a) ** 2)
    assert np.sqrt(np.mean(z**2)) < 1.5


@pytest.fixture(scope="module")
def furnace() -> fz.Film:
    return render(two_balls(), [dome(1.0)])


@pytest.mark.parametrize(
    "lights",
    [
        pytest.param(lambda: [dome(1.0, image=True)], id="image dome"),
        pytest.param(lambda: [distant(1.0)], id="distant"),
        pytest.param(lambda: rects(1.0), id="rects"),
        pytest.param(lambda: [*rects(0.6, image=True), distant(0.4)], id="rects with images"),
        pytest.param(lambda: [dome(0.2), dome(0.2, image=True), distant(0.3), *rects(0.3)], id="all"),
        pytest.param(lambda: [dome(1.5), *rects(-0.5)], id="one that takes away"),
        pytest.param(lambda: [dome(0.5), *rects(0.5, "box")], id="two groups"),
    ],
)
def test_any_mix_of_lights_of_equal_radiance_gives_the_same_picture(furnace, lights):
    check_same(render(two_balls(), lights()), furnace)


def test_a_shining_box_around_is_the_furnace_too():
    # Without bounces, as the box would reflect: a glossy lobe then waits for luck.
    scene = two_balls()
    box = trimesh.creation.box((2 * HALF,) * 3)
    mesh = fz.Mesh(np.asarray(box.vertices, np.float32), np.asarray(box.faces, np.int32)[:, ::-1].copy())
    black = fz.StandardMaterial(diffuse_color=(0.0,) * 3)
    index = scene.add_object("/box", scene.add_mesh(mesh, "/box"), scene.add_material("/box", black))
    light = fz.Light(fz.MeshLight(mesh, index), radiance=[0.6] * 3, path="/box")
    boxed = render(scene, [light, *rects(0.4)], max_bounces=0)
    check_same(boxed, render(two_balls(), [dome(1.0)], max_bounces=0), layers=("translucency", "diffuse"))


def mesh_of(shape: str) -> trimesh.Trimesh:
    if shape == "sphere":
        return trimesh.creation.icosphere(4, 0.4)
    if shape == "rect":
        return trimesh.Trimesh(
            [[-0.5, -0.3, 0], [0.5, -0.3, 0], [0.5, 0.3, 0], [-0.5, 0.3, 0]], [[0, 2, 1], [0, 3, 2]], process=False
        )
    turns = np.linspace(0, 2 * np.pi, 128, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    here, beside = np.arange(128), np.roll(np.arange(128), -1)
    if shape == "disk":
        corners = np.concatenate([[[0, 0, 0]], np.pad(0.5 * ring, ((0, 0), (0, 1)))])
        return trimesh.Trimesh(corners, np.stack([0 * here, beside + 1, here + 1], axis=1), process=False)
    ends = [np.column_stack([np.full(128, x), 0.2 * ring]) for x in (-0.7, 0.7)]
    sides = [np.stack([here, beside, here + 128], axis=1), np.stack([beside, beside + 128, here + 128], axis=1)]
    return trimesh.Trimesh(np.concatenate(ends), np.concatenate(sides), process=False)


@pytest.mark.parametrize(
    ("shape", "light"),
    [
        ("sphere", fz.SphereLight(0.4)),
        ("cylinder", fz.CylinderLight(1.4, 0.2)),
        ("disk", fz.DiskLight(0.5)),
        ("rect", fz.RectLight(1.0, 0.6)),
        ("rect", fz.RectLight(1.0, 0.6, np.ones((2, 3, 3), np.float32), "/white")),
    ],
    ids=["sphere", "cylinder", "disk", "rect", "rect with an image"],
)
def test_a_light_is_as_good_as_the_mesh_of_its_shape(shape, light):
    # Above the balls, in front, out of sight; it shines down and back.
    turn = trimesh.transformations.rotation_matrix(np.radians(-60), [1, 0, 0])
    turn[:3, 3] = (0.2, 2.2, 1.2)
    matrix = np.ascontiguousarray(turn.T)
    options = {"max_bounces": 0, "samples": 32}
    plain = render(two_balls(), [fz.Light(light, radiance=[40.0] * 3, matrix=matrix, path="/light")], **options)
    scene = two_balls()
    made = mesh_of(shape)
    mesh = fz.Mesh(np.asarray(made.vertices, np.float32), np.asarray(made.faces, np.int32))
    black = scene.add_material("/black", fz.StandardMaterial(diffuse_color=(0.0,) * 3))
    index = scene.add_object("/mesh", scene.add_mesh(mesh, "/mesh"), black, matrix)
    lamp = fz.Light(fz.MeshLight(mesh, index), radiance=[40.0] * 3, matrix=matrix, path="/mesh")
    shown = render(scene, [lamp], **options)
    assert plain["diffuse"].mean() > 0.01
    # Lobes without bounces wait for luck: the specular layer has more noise than a mean over a ball bears.
    check_same(shown, plain, layers=("translucency", "diffuse"))


@pytest.mark.parametrize("shape", [fz.SphereLight(0.3), fz.RectLight(1.0, 0.5), fz.DistantLight(3.0)])
def test_a_light_and_its_negative_twin_leave_the_picture(shape):
    options = {"spacing": 0.2, "bake_samples": 16, "resolution": (64, 36), "samples": 64}
    before = fz.render(ice_over_floor(), **options)
    scene = ice_over_floor()
    for sign in (1.0, -1.0):
        radiance = [sign * x for x in (30.0, 20.0, 10.0)]
        scene.add_light(fz.Light(shape, radiance=radiance, matrix=placed(-1, 2, 3), path=f"/twin{sign}", group="key"))
    after = fz.render(scene, **options)
    # Translucency to half precision, here to the bit of a float or so.
    np.testing.assert_allclose(after["translucency"], before["translucency"], rtol=2.0**-11, atol=1e-6)
    variance = before["variance"][:, :, 0] + after["variance"][:, :, 0]
    noisy = variance > 1e-12
    difference = (after["beauty"][:, :, :3] - before["beauty"][:, :, :3]) @ LUMINANCE
    z = difference[noisy] / np.sqrt(variance[noisy])
    assert np.sqrt(np.mean(z**2)) < 1.5
    np.testing.assert_allclose(difference[~noisy], 0.0, atol=1e-5)
    for layer in ("diffuse", "specular"):
        error = np.sqrt(variance.sum()) / variance.size
        assert abs(((after[layer] - before[layer]) @ LUMINANCE).mean()) < 4 * error + 1e-5, layer


def test_twins_in_a_crowd_cancel_within_noise():
    rng = np.random.default_rng(0)
    scene, empty = ice_over_floor(key=0.0), ice_over_floor(key=0.0)
    for i, (x, z) in enumerate(rng.uniform(-2, 2, (40, 2))):
        for sign in (1.0, -1.0):
            at = placed(x, 2.0, z)
            scene.add_light(fz.Light(fz.SphereLight(0.1), radiance=[5.0 * sign] * 3, matrix=at, path=f"/{i}{sign}"))
    options = {"spacing": 0.2, "bake_samples": 64, "resolution": (32, 18), "samples": 32}
    with_crowd, without = fz.render(scene, **options), fz.render(empty, **options)
    alone = ice_over_floor(key=0.0)
    for light in scene.lights[2::2]:
        alone.add_light(light)
    scale = (fz.render(alone, **options)["translucency"] - without["translucency"]).mean()
    assert abs((with_crowd["translucency"] - without["translucency"]).mean()) < 0.02 * scale


def ball_in(ice: trimesh.Trimesh | None) -> float:
    """Radiance of a white ball under an even sky of radiance 1, in the middle of clear ice or of air."""
    scene = fz.Scene()
    white = fz.StandardMaterial(diffuse_color=(1.0,) * 3, use_specular_workflow=True)
    clear = fz.IceMaterial(fz.Medium(sigma_s_prime=1e-6, sigma_a=0.0), roughness=0.01)
    bodies = [("/white", trimesh.creation.icosphere(4, 0.3), white)] + ([("/ice", ice, clear)] if ice else [])
    for path, body, look in bodies:
        mesh = fz.Mesh(np.asarray(body.vertices, np.float32), np.asarray(body.faces, np.int32))
        scene.add_object(path, scene.add_mesh(mesh, path), scene.add_material(path, look))
    scene.add_light(dome(1.0))
    scene.camera = fz.Camera(matrix=placed(0, 0, 8), focal_length=500)
    return float(fz.render(scene, resolution=(16, 9), samples=64)["beauty"][:, :, 1].mean())


def test_what_a_white_ball_in_clear_ice_keeps():
    """A limit of light that goes in as through a flat face: all of it should be left, as clear ice takes nothing."""
    assert ball_in(None) == pytest.approx(1.0, rel=0.005)
    assert ball_in(trimesh.creation.icosphere(5, 1.0)) == pytest.approx(0.66, abs=0.02)
    assert ball_in(trimesh.creation.box((2, 2, 2))) == pytest.approx(0.75, abs=0.02)


# ---- occlusion ------------------------------------------------------------------------------------------------------


def corner_factor(a: float, b: float, c: float) -> float:
    x, y = a / c, b / c
    return (x / np.hypot(1, x) * np.arctan(y / np.hypot(1, x)) + y / np.hypot(1, y) * np.arctan(x / np.hypot(1, y))) / (
        2 * np.pi
    )


def quad(half: float, height: float) -> fz.Mesh:
    corners = [[-half, height, half], [half, height, half], [half, height, -half], [-half, height, -half]]
    return fz.Mesh(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


@pytest.mark.parametrize("kind", ["ice", "grey"])
def test_occlusion_and_bent_normal_below_a_roof(kind):
    scene = fz.Scene()
    medium = fz.Medium(sigma_s_prime=(8.0, 9.0, 10.0), sigma_a=(0.6, 0.2, 0.05))
    look = fz.IceMaterial(medium, refraction=0.0) if kind == "ice" else fz.StandardMaterial()
    floor = scene.add_mesh(quad(2.0, 0.0), "/floor")
    scene.add_object("/floor", floor, scene.add_material("/m", look))
    roof = scene.add_mesh(quad(0.7, 1.0), "/roof")
    scene.add_object("/roof", roof, scene.add_material("/grey", fz.StandardMaterial()), placed(0.4))
    scene.add_light(dome(1.0))
    down = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0.9, 0, 1]], float)
    scene.camera = fz.Camera(matrix=down, focal_length=300)
    film = fz.render(
        scene,
        aovs=["occlusion", "bent_normal"],
        resolution=(16, 9),
        samples=256,
        spacing=0.05,
        bake_samples=256,
        bake_bounces=0,
    )
    expected = 1 - 2 * (corner_factor(1.1, 0.7, 1.0) + corner_factor(0.3, 0.7, 1.0))
    assert film["occlusion"].shape == (9, 16, 1)
    assert film["occlusion"].mean() == pytest.approx(expected, rel=0.02)
    bent = film["bent_normal"].reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(bent, axis=1), 1.0, atol=1e-4)
    # The roof stands to +x: what is open leans to -x.
    assert bent[:, 0].mean() < -0.1
    assert abs(bent[:, 2].mean()) < 0.05
    plain = fz.render(scene, resolution=(16, 9), samples=1, spacing=0.2, bake_samples=1)
    assert "occlusion" not in list(plain)


@pytest.mark.parametrize(
    ("x", "side", "is_buried"), [(0.0, 1, True), (0.0, -1, True), (0.95, 1, False), (1.4, 1, False)]
)
@pytest.mark.parametrize("refraction", [0.0, 1.0])
def test_a_light_inside_ice_is_named(x, side, is_buried, refraction):
    """Whichever way the mesh is wound, and whether or not the ice is seen into."""
    scene = fz.Scene()
    ball = trimesh.creation.icosphere(3, 1.0)
    mesh = fz.Mesh(np.asarray(ball.vertices, np.float32), np.asarray(ball.faces, np.int32)[:, ::side].copy())
    ice = fz.IceMaterial(fz.Medium(sigma_s_prime=(8.0,) * 3, sigma_a=(0.1,) * 3), refraction=refraction)
    scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), scene.add_material("/ice", ice), placed(3, 0, 0))
    scene.add_light(fz.Light(fz.SphereLight(0.1), matrix=placed(3 + x, 0, 0), path="/Lamp"))
    options = {"resolution": (8, 8), "samples": 1, "bake_samples": 4, "spacing": 0.5}
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fz.render(scene, **options)
    about = [str(w.message) for w in said if "/Lamp" in str(w.message)]
    expected = "/Lamp: must lie outside of ice to light its core, got a place inside /ice."
    assert [message[: len(expected)] for message in about] == ([expected] if is_buried else [])


def test_the_default_group_has_two_names():
    scene = ice_over_floor()
    scene.add_light(fz.Light(fz.SphereLight(0.2), matrix=placed(-2, 3, 1), radiance=[20.0] * 3, group="default"))
    scene.add_light(fz.Light(fz.SphereLight(0.2), matrix=placed(0, 3, 2), radiance=[20.0] * 3))
    film = fz.render(scene, resolution=(16, 9), samples=4, bake_samples=4, spacing=0.4)
    groups = film.additive_layers()
    assert groups["diffuse"] == ["diffuse_default", "diffuse_key", "diffuse_sky"]
    for name, layers in groups.items():
        np.testing.assert_allclose(sum(film[layer] for layer in layers), film[name], rtol=1e-5, atol=1e-6)
