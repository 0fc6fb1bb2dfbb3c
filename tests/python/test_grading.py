"""A picture changed after its render is the picture of a new render with that change, to half precision."""

import json

import numpy as np
import pytest

import frazil as fz

SIZE = (40, 32)
KNOTS = ([0.0, 0.02, 0.08], [(1.0, 0.9, 0.8), (0.4, 0.8, 1.0), (0.05, 0.3, 0.9)])
NEW_COLORS = [(0.2, 0.5, 1.0), (1.0, 0.3, 0.1), (0.7, 0.7, 0.0)]
MODES = ("off", "ratio", "conserve", "fill", "linear")


def grid(half=1.0, y=0.0, count=2):
    """A square of count x count quads, facing up."""
    axis = np.linspace(-half, half, count + 1)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    positions = np.stack([x, np.full_like(x, y), z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(range(count), range(count), indexing="ij")
    a = (i * (count + 1) + j).ravel()
    triangles = np.concatenate([np.stack([a, a + 1, a + count + 2], 1), np.stack([a, a + count + 2, a + count + 1], 1)])
    return positions.astype(np.float32), triangles.astype(np.int32)


def block(size=0.2):
    """A cube standing on y = 0."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], np.float32) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners, np.array(triangles, np.int32)


def light(name, group, shape, radiance, height=2.0, x=0.0):
    made = fz.Light(shape, path=f"/Lights/{name}", radiance=radiance, group=group)
    matrix = np.eye(4)
    matrix[1:3, 1:3] = [[0, -1], [1, 0]]  # -z to -y
    matrix[3, :3] = x, height, 0
    made.matrix = matrix
    return made


def scene(
    key=(4.0, 3.6, 3.0), rim=(0.5, 1.0, 3.0), fill=(-0.2, -0.2, -0.1), colors=KNOTS[1], mode="ratio", strength=1.0,
    preserve=False, glow=0.3,
):  # fmt: skip
    """A block of ice on a grey floor with a glowing block, three lights, one of them negative."""
    made = fz.Scene()
    floor, cube, lamp = (made.add_mesh(fz.Mesh(*shape)) for shape in (grid(), block(), block(0.05)))
    ice = fz.IceMaterial(
        fz.Medium(sigma_s_prime=(60.0, 60.0, 60.0), sigma_a=(4.0, 1.0, 0.4), eta=1.31),
        roughness=0.3,
        ramp_distances=KNOTS[0],
        ramp_colors=colors,
        ramp_preserve_energy=preserve,
        compensation=mode,
        compensation_strength=strength,
        spacing=0.02,
    )
    looks = [
        made.add_material(fz.Material("/Looks/Floor", fz.StandardMaterial(diffuse_color=(0.4, 0.4, 0.4)))),
        made.add_material(fz.Material("/Looks/Ice", ice)),
        made.add_material(fz.Material("/Looks/Lamp", fz.StandardMaterial(emissive_color=(glow, glow, 0.0)))),
    ]
    moved = np.eye(4)
    moved[3, 0] = 0.4
    made.add_object(fz.Object("/World/Floor", floor, looks[0]))
    made.add_object(fz.Object("/World/Ice", cube, looks[1]))
    made.add_object(fz.Object("/World/Lamp", lamp, looks[2], moved))
    made.lights = [
        light("Key", "key", fz.RectLight(1.0, 1.0), key, x=-0.5),
        light("Rim", "rim", fz.RectLight(0.5, 0.5), rim, x=1.0),
        light("Fill", "fill", fz.RectLight(1.0, 1.0), fill),
        fz.Light(fz.DomeLight(), path="/Lights/Sky", radiance=(0.1, 0.15, 0.2), group="sky"),
    ]
    camera = np.eye(4)
    camera[3, :3] = 0, 0.25, 1.5
    made.camera = fz.Camera(path="/Camera", matrix=camera, focal_length=50, horizontal_aperture=30, vertical_aperture=24)
    return made


def render(aovs=(), bounces=1, **changes):
    return fz.render(
        scene(**changes), resolution=SIZE, samples=4, bake_samples=4, bake_bounces=bounces, spacing=0.02, aovs=aovs
    )


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """An EXR with all that a recipe may ask for; ice does not light ice in it."""
    path = tmp_path_factory.mktemp("grade") / "in.exr"
    render(aovs=["translucency_ramp", *(f"translucency_{mode}" for mode in MODES)], bounces=0).save(path, "zip")
    return path


@pytest.fixture
def film(file):
    return fz.Film.load(file, keep_half=True)


def assert_same_picture(graded, expected, parts):
    """Equal to half precision of what was added up: `parts` is the sum of the layers' magnitudes."""
    error = np.abs(graded["beauty"][:, :, :3] - expected["beauty"][:, :, :3])
    assert np.all(error <= 2.0**-10 * parts + 1e-6), float((error / (parts + 1e-6)).max())
    assert np.ptp(expected["beauty"][:, :, :3]) > 0.1


def magnitude(film, layers=("translucency", "diffuse", "specular", "emission", "background")):
    groups = json.loads(film.metadata["frazil:light_groups"])
    return sum(np.abs(film[f"{layer}_{group}"].astype(np.float32)) for layer in layers for group in groups)


# ---- regrade = rerender ----------------------------------------------------------------------------------------------


def test_a_light_mix_is_a_new_render(file, film):
    recipe = {
        "lights": {
            "key": {"intensity": 0.5, "color": [1.0, 0.8, 0.5]},
            "rim": {"exposure": 1.0},
            "fill": {"sign": -1},
            "sky": {"intensity": 0.0},
        }
    }
    dimmed = tuple(0.5 * a * b for a, b in zip((4.0, 3.6, 3.0), (1.0, 0.8, 0.5), strict=True))
    for bounces in (0, 1):
        start = film if bounces == 0 else render(bounces=1)
        expected_scene = scene(key=dimmed, rim=(1.0, 2.0, 6.0), fill=(0.2, 0.2, 0.1))
        expected_scene.lights = [*expected_scene.lights[:3], dark_sky()]
        options = {"samples": 4, "bake_samples": 4, "bake_bounces": bounces, "spacing": 0.02}
        expected = fz.render(expected_scene, resolution=SIZE, **options)
        graded = fz.grade(start, recipe)
        assert_same_picture(graded, expected, 2 * magnitude(film))


def dark_sky():
    return fz.Light(fz.DomeLight(), path="/Lights/Sky", radiance=(0.0, 0.0, 0.0), group="sky")


@pytest.mark.parametrize("preserve", [False, True])
def test_new_ramp_colours_are_a_new_render(film, preserve):
    graded = fz.grade(film, {"ramp": {"colors": NEW_COLORS, "preserve_energy": preserve}})
    expected = render(colors=NEW_COLORS, preserve=preserve, bounces=0)
    assert_same_picture(graded, expected, 2 * magnitude(film) + np.abs(expected["translucency"]))


def test_the_ramps_own_colours_give_the_picture_back(film):
    graded = fz.grade(film, {"ramp": {"/Looks/Ice": {"colors": KNOTS[1]}}})
    assert_same_picture(graded, film, 2 * magnitude(film))


def test_ramp_colours_and_lights_change_together(film):
    graded = fz.grade(film, {"ramp": {"colors": NEW_COLORS}, "lights": {"key": {"intensity": 0.25}}})
    expected = render(colors=NEW_COLORS, key=(1.0, 0.9, 0.75), bounces=0)
    assert_same_picture(graded, expected, 2 * magnitude(film) + np.abs(expected["translucency"]))


@pytest.mark.parametrize("mode", MODES)
def test_another_compensation_is_a_new_render(film, mode):
    graded = fz.grade(film, {"compensation": {"mode": mode, "strength": 0.6}})
    expected = render(mode=mode, strength=0.6, bounces=0)
    if mode == "fill":  # its light is sampled, by other numbers in the two renders
        np.testing.assert_allclose(graded["beauty"].mean(), expected["beauty"].mean(), rtol=0.02)
    else:
        assert_same_picture(graded, expected, 2 * magnitude(film) + np.abs(expected["translucency"]))


def test_another_strength_is_a_new_render(film):
    graded = fz.grade(film, {"compensation": {"strength": 0.25}})
    assert_same_picture(graded, render(strength=0.25, bounces=0), 2 * magnitude(film))


def test_components_are_scaled_by_themselves_and_by_light(film):
    recipe = {
        "components": {"specular": {"intensity": 0.0}, "emission": {"exposure": 1}},
        "lights": {"rim": {"translucency": {"color": [0.0, 0.0, 1.0]}}},
    }
    values = {name: film[name].astype(np.float64) for name in film}
    expected = values["diffuse"] + 2 * values["emission"] + values["background"] + values["translucency"]
    expected -= values["translucency_rim"] * [1, 1, 0]
    graded = fz.grade(film, recipe)["beauty"][:, :, :3]
    np.testing.assert_allclose(graded, expected, atol=2e-3, rtol=2e-3)


def test_what_glows_stays_when_a_light_goes_out(film):
    graded = fz.grade(film, {"lights": {name: {"intensity": 0} for name in ("key", "rim", "fill", "sky")}})
    expected = sum(film[f"{layer}_default"].astype(np.float32) for layer in ("diffuse", "specular", "emission"))
    expected += film["translucency_default"]
    np.testing.assert_allclose(graded["beauty"][:, :, :3], expected, atol=1e-4)
    assert film["emission"].max() > 0.2


def test_kept_layers_sum_to_the_graded_beauty_and_can_be_graded_again(film):
    recipe = {"lights": {"key": {"intensity": 0.3}}, "ramp": {"colors": NEW_COLORS}}
    graded = fz.grade(film, recipe, keep_layers=True)
    total = sum(graded[name] for name in ("translucency", "diffuse", "specular", "emission", "background"))
    np.testing.assert_allclose(total, graded["beauty"][:, :, :3], rtol=1e-4, atol=1e-4)
    groups = json.loads(film.metadata["frazil:light_groups"])
    parts = sum(graded[f"translucency_{group}"] for group in groups)
    np.testing.assert_allclose(parts, graded["translucency"], rtol=1e-4, atol=1e-5)
    undone = fz.grade(graded, {"lights": {"key": {"intensity": 1 / 0.3}}})
    expected = fz.grade(film, {"ramp": {"colors": NEW_COLORS}})
    np.testing.assert_allclose(undone["beauty"], expected["beauty"], rtol=2e-3, atol=2e-3)


def test_an_empty_recipe_changes_nothing(film):
    graded = fz.grade(film, {})
    np.testing.assert_array_equal(graded["beauty"], film["beauty"].astype(np.float32))
    assert graded["Z"] is film["Z"]
    assert "diffuse" not in graded


def test_without_some_components_the_change_is_added_to_the_beauty(film):
    layers = {name: array for name, array in film.layers.items() if name.startswith(("beauty", "diffuse"))}
    graded = fz.grade(fz.Film(layers, film.metadata), {"components": {"diffuse": {"intensity": 0.0}}})
    expected = film["beauty"][:, :, :3].astype(np.float32) - film["diffuse"]
    np.testing.assert_allclose(graded["beauty"][:, :, :3], expected, atol=2e-3)
