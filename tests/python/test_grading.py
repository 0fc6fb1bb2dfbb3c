"""A picture changed after its render is the picture of a new render with that change, to half precision."""

import json

import numpy as np
import pytest

import frazil as fz

SIZE = (40, 32)
KNOTS = ([0.0, 0.02, 0.08], [(1.0, 0.9, 0.8), (0.4, 0.8, 1.0), (0.05, 0.3, 0.9)])
NEW_COLORS = [(0.2, 0.5, 1.0), (1.0, 0.3, 0.1), (0.7, 0.7, 0.0)]
COMPONENTS = ("translucency", "diffuse", "specular", "refraction", "volume", "emission", "background")
MODES = ("off", "ratio", "conserve", "depth", "fill", "linear")


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
    matrix = np.eye(4)
    matrix[1:3, 1:3] = [[0, 0], [0, 0]]
    matrix[1, 2], matrix[2, 1] = -1, 1  # -z to -y
    matrix[3, :3] = x, height, 0
    return fz.Light(shape, path=f"/Lights/{name}", radiance=radiance, group=group, matrix=matrix)


def scene(
    key=(4.0, 3.6, 3.0), rim=(0.5, 1.0, 3.0), fill=(-0.2, -0.2, -0.1), colors=KNOTS[1], mode="ratio", strength=1.0,
    preserve=False, glow=0.3,
    sky=(0.1, 0.15, 0.2),
):  # fmt: skip
    """A block of ice on a grey floor with a glowing block, three lights, one of them negative."""
    made = fz.Scene()
    floor, cube, lamp = (
        made.add_mesh(fz.Mesh(*shape), path)
        for path, shape in (("/Floor", grid()), ("/Ice", block()), ("/Lamp", block(0.05)))
    )
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
    grey = made.add_material("/Looks/Floor", fz.StandardMaterial(diffuse_color=(0.4, 0.4, 0.4)))
    core = made.add_material("/Looks/Ice", ice)
    glowing = made.add_material("/Looks/Lamp", fz.StandardMaterial(emissive_color=(glow, glow, 0.5 * glow)))
    moved = np.eye(4)
    moved[3, 0] = 0.4
    made.add_object("/World/Floor", floor, grey)
    made.add_object("/World/Ice", cube, core)
    made.add_object("/World/Lamp", lamp, glowing, moved)
    made.add_light(light("Key", "key", fz.RectLight(1.0, 1.0), key, x=-0.5))
    made.add_light(light("Rim", "rim", fz.RectLight(0.5, 0.5), rim, x=1.0))
    made.add_light(light("Fill", "fill", fz.RectLight(1.0, 1.0), fill))
    made.add_light(fz.Light(fz.DomeLight(), path="/Lights/Sky", radiance=sky, group="sky"))
    camera = np.eye(4)
    camera[3, :3] = 0, 0.25, 1.5
    made.camera = fz.Camera(
        path="/Camera", matrix=camera, focal_length=50, horizontal_aperture=30, vertical_aperture=24
    )
    return made


def render(aovs=(), bounces=1, samples=4, **changes):
    options = {"samples": samples, "bake_samples": 4, "bake_bounces": bounces, "aovs": aovs}
    return fz.render(scene(**changes), resolution=SIZE, **options)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """An EXR with all that a recipe may ask for; ice is lit by floor and ice, and seen in the floor and through ice."""
    path = tmp_path_factory.mktemp("grade") / "in.exr"
    render(aovs=["translucency_ramp", *(f"compensation_{mode}" for mode in MODES)]).save(path, "zip")
    return path


@pytest.fixture
def film(file):
    return fz.Film.load(file, keep_half=True)


def assert_same_picture(graded, expected, parts):
    """Equal to half precision of what was added up: `parts` is the sum of the layers' magnitudes."""
    error = np.abs(graded["beauty"][:, :, :3] - expected["beauty"][:, :, :3])
    assert np.all(error <= 2.0**-10 * parts + 1e-6), float((error / (parts + 1e-6)).max())
    assert np.ptp(expected["beauty"][:, :, :3]) > 0.1


def magnitude(film, layers=COMPONENTS):
    groups = film.metadata["frazil:light_groups"]
    groups = json.loads(groups) if isinstance(groups, str) else groups
    return sum(np.abs(film[f"{layer}_{group}"].astype(np.float32)) for layer in layers for group in groups)


# ---- regrade = rerender ----------------------------------------------------------------------------------------------


def test_all_lights_scaled_alike_is_a_new_render(film):
    factors = {"key": -0.5, "rim": 0.5, "fill": -0.5, "sky": 0.5}
    lights = {group: {"intensity": abs(factor), "sign": 1 if factor > 0 else -1} for group, factor in factors.items()}
    values = {"key": (4.0, 3.6, 3.0), "rim": (0.5, 1.0, 3.0), "fill": (-0.2, -0.2, -0.1), "sky": (0.1, 0.15, 0.2)}
    scaled = {group: tuple(factors[group] * v for v in radiance) for group, radiance in values.items()}
    assert_same_picture(fz.grade(film, {"lights": lights}), render(**scaled), 2 * magnitude(film))


def test_a_light_mix_is_a_new_render(film):
    """Noise and all: which light a path asks does not depend on how bright its group is."""
    recipe = {
        "lights": {
            "key": {"intensity": 0.5, "color": [1.0, 0.8, 0.5]},
            "rim": {"exposure": 1.0},
            "fill": {"sign": -1},
            "sky": {"intensity": 0.25},
        }
    }
    new = {"key": (2.0, 1.44, 0.75), "rim": (1.0, 2.0, 6.0), "fill": (0.2, 0.2, 0.1), "sky": (0.025, 0.0375, 0.05)}
    expected = render(**new)
    assert np.abs(expected["beauty"] - film["beauty"]).max() > 0.1
    assert_same_picture(fz.grade(film, recipe), expected, 2 * magnitude(film))


def assert_same_translucency(film, recipe, expected):
    """In the beauty too: ice that is seen in the floor and through ice changes as well."""
    graded = fz.grade(film, recipe, keep_layers=True)
    error = np.abs(graded["translucency"] - expected["translucency"])
    parts = magnitude(film, ["translucency"]) + np.abs(expected["translucency"])
    assert np.all(error <= 2.0**-9 * parts + 1e-6), float((error / (parts + 1e-6)).max())
    assert np.ptp(expected["translucency"]) > 0.05
    changes = [
        sum(made[layer] - film[layer].astype(np.float32) for layer in ("diffuse", "specular", "refraction"))
        for made in (graded, expected)
    ]
    assert np.abs(changes[1]).max() > 3e-4
    assert np.abs(changes[0] - changes[1]).max() < 0.3 * np.abs(changes[1]).max()
    assert_same_picture(graded, expected, 4 * (magnitude(film) + magnitude(expected)))


def test_a_white_ramp_is_a_new_render(film):
    assert_same_translucency(film, {"ramp": {"colors": [(1, 1, 1)] * 3}}, render(colors=[(1, 1, 1)] * 3))


@pytest.mark.parametrize("preserve", [False, True])
def test_new_ramp_colours_are_a_new_render(film, preserve):
    expected = render(colors=NEW_COLORS, preserve=preserve)
    assert np.abs(expected["translucency"] - film["translucency"]).max() > 0.05
    assert_same_translucency(film, {"ramp": {"colors": NEW_COLORS, "preserve_energy": preserve}}, expected)


def test_the_ramps_own_colours_give_the_picture_back(film):
    graded = fz.grade(film, {"ramp": {"/Looks/Ice": {"colors": KNOTS[1]}}})
    assert_same_picture(graded, film, 2 * magnitude(film))


def test_ramp_colours_and_lights_change_together(film):
    factors = {"key": 0.25, "rim": 3.0, "fill": 0.0, "sky": 1.0}
    values = {"key": (1.0, 0.9, 0.75), "rim": (1.5, 3.0, 9.0), "fill": (0.0, 0.0, 0.0)}
    recipe = {"ramp": {"colors": NEW_COLORS}, "lights": {name: {"intensity": f} for name, f in factors.items()}}
    graded = fz.grade(film, recipe, keep_layers=True)["translucency"]
    expected = render(colors=NEW_COLORS, **values)["translucency"]
    np.testing.assert_allclose(graded, expected, rtol=2**-8, atol=2e-3 * expected.max())


@pytest.mark.parametrize("mode", MODES)
def test_another_compensation_is_a_new_render(film, mode):
    expected = render(mode=mode, strength=0.6)
    assert_same_translucency(film, {"compensation": {"mode": mode, "strength": 0.6}}, expected)


def test_another_strength_is_a_new_render(film):
    assert_same_translucency(film, {"compensation": {"strength": 0.25}}, render(strength=0.25))


def test_another_strength_of_depth_is_a_new_render():
    rendered = render(mode="depth", aovs=["compensation_off"])
    expected = render(mode="depth", strength=0.3)
    assert_same_translucency(rendered, {"compensation": {"strength": 0.3}}, expected)


def test_components_are_scaled_by_themselves_and_by_light(film):
    recipe = {
        "components": {"specular": {"intensity": 0.0}, "emission": {"exposure": 1}},
        "lights": {"rim": {"translucency": {"color": [0.0, 0.0, 1.0]}}},
    }
    values = {name: film[name].astype(np.float64) for name in film}
    expected = sum(values[name] for name in COMPONENTS) - values["specular"] + values["emission"]
    expected -= values["translucency_rim"] * [1, 1, 0]
    graded = fz.grade(film, recipe)["beauty"][:, :, :3]
    np.testing.assert_allclose(graded, expected, atol=2e-3, rtol=2e-3)


def test_what_glows_stays_when_a_light_goes_out(film):
    graded = fz.grade(film, {"lights": {name: {"intensity": 0} for name in ("key", "rim", "fill", "sky")}})
    expected = sum(film[f"{layer}_default"].astype(np.float32) for layer in COMPONENTS)
    np.testing.assert_allclose(graded["beauty"][:, :, :3], expected, atol=1e-4)
    assert film["emission"].max() > 0.2


def test_kept_layers_sum_to_the_graded_beauty_and_can_be_graded_again(film):
    recipe = {"lights": {"key": {"intensity": 0.3}}, "ramp": {"colors": NEW_COLORS}}
    graded = fz.grade(film, recipe, keep_layers=True)
    total = sum(graded[name] for name in COMPONENTS)
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


# ---- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        ({"light": {}}, r"recipe: light: key must be one of lights, .* Did you mean 'lights'"),
        (
            {"lights": {"key": {"intensty": 1}}},
            r"lights\.key\.intensty: key must be one of .* Did you mean 'intensity'",
        ),
        ({"lights": {"key": {"intensity": "much"}}}, r"lights\.key\.intensity: must be a finite number, got 'much'"),
        ({"lights": {"key": {"color": [1, 2]}}}, r"lights\.key\.color: must be a number or three"),
        ({"lights": {"key": {"sign": 0}}}, r"lights\.key\.sign: must be 1 or -1"),
        ({"lights": {"key": 3}}, r"lights\.key: must be a table"),
        ({"components": {"specualr": {}}}, r"components\.specualr: key must be one of .* Did you mean 'specular'"),
        ({"ramp": {"colors": []}}, r"ramp\.colors: must be a list of colours"),
        ({"ramp": {"colors": [[-1, 0, 0]]}}, r"ramp\.colors\[0\]\.color: must be >= 0"),
        ({"compensation": {"mode": "ration"}}, r"compensation\.mode: .* Did you mean 'ratio'"),
        ({"compensation": {"strength": 2}}, r"compensation\.strength: must be in 0\.\.1, got 2"),
        ({"color": {"gamma": 0}}, r"color\.gamma: must be >= 0\.001"),
        ({"color": {"temperature": 100}}, r"color\.temperature: must be in 1667\.\.25000"),
        ({"mattes": {"rocks": {"exposure": 1}}}, r"mattes\.rocks: must have either layer or some of objects"),
        (
            {"lights": {"kee": {"intensity": 1}}},
            r"lights must be of a light group of the picture \(key, rim.*got 'kee'",
        ),
        ({"ramp": {"colors": [[1, 1, 1]]}}, r"ramp colors must be 3 for /Looks/Ice, one per knot, got 1"),
        ({"ramp": {"/Looks/Snow": {"colors": [[1, 1, 1]]}}}, r"ramp must be of one of /Looks/Ice, got '/Looks/Snow'"),
        ({"mattes": {"a": {"layer": "nothing", "exposure": 1}}}, r"mattes\.a: layer must be in the picture"),
        (
            {"mattes": {"a": {"objects": ["/x"], "exposure": 1}}},
            r"crypto_object00 .* Render with --aov all,crypto_object",
        ),
    ],
)
def test_recipes_that_cannot_be_served_are_refused(film, recipe, message):
    with pytest.raises(ValueError, match=message):
        fz.grade(film, recipe)


def test_missing_layers_name_the_option_that_makes_them(film):
    layers = {name: array for name, array in film.layers.items() if name in ("beauty", *COMPONENTS)}
    metadata = {key: value for key, value in film.metadata.items() if key != "frazil:ramp_knots"}
    bare = fz.Film(layers, metadata)
    with pytest.raises(ValueError, match=r"layer translucency_ramp0 must be in the picture.*--aov translucency_ramp"):
        fz.grade(bare, {"ramp": {"colors": NEW_COLORS}})
    with pytest.raises(ValueError, match=r"layer compensation_conserve must be .*--aov compensation_conserve"):
        fz.grade(bare, {"compensation": {"mode": "conserve"}})
    with pytest.raises(ValueError, match=r"layers translucency_key, .* must be in the picture"):
        fz.grade(bare, {"lights": {"key": {"intensity": 2}}})


def test_foreign_pictures_take_colour_corrections_and_refuse_the_rest():
    foreign = fz.Film({"beauty": np.full((3, 4, 4), 0.5, np.float32)}, {"Software": "another"})
    assert fz.grade(foreign, {"color": {"exposure": 1.0}})["beauty"][0, 0].tolist() == [1.0, 1.0, 1.0, 0.5]
    with pytest.raises(ValueError, match=r"light group of the picture"):
        fz.grade(foreign, {"lights": {"key": {"intensity": 2}}})
    with pytest.raises(ValueError, match=r"layer specular must be in the picture"):
        fz.grade(foreign, {"components": {"specular": {"intensity": 2}}})
    with pytest.raises(ValueError, match=r"must have a beauty"):
        fz.grade(fz.Film({"Z": np.zeros((2, 2, 1), np.float32)}), {})


def test_truncated_files_and_wrong_toml_are_refused(tmp_path, file):
    (tmp_path / "cut.exr").write_bytes(file.read_bytes()[:20000])
    with pytest.raises(OSError, match=r"cut\.exr"):
        fz.grade(tmp_path / "cut.exr", {})
    (tmp_path / "bad.toml").write_text("lights = [")
    with pytest.raises(ValueError, match=r"bad\.toml: recipe must be TOML"):
        fz.grade(file, tmp_path / "bad.toml")
    with pytest.raises(FileNotFoundError, match=r"none\.toml: recipe must be a file"):
        fz.grade(file, tmp_path / "none.toml")


# ---- colour ----------------------------------------------------------------------------------------------------------


def corrected(rgb, **correction):
    film = fz.Film({"beauty": np.broadcast_to(np.float32([*rgb, 1.0]), (2, 3, 4)).copy()})
    return fz.grade(film, {"color": correction})["beauty"][0, 0, :3]


def test_corrections_are_their_formulas():
    rgb = np.array([0.2, 0.5, -0.1])
    np.testing.assert_allclose(corrected(rgb, exposure=-1.0, gain=[1.0, 2.0, 1.0]), [0.1, 0.5, -0.05], rtol=1e-6)
    grey = rgb @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(corrected(rgb, saturation=0.0), [grey] * 3, rtol=1e-5)
    np.testing.assert_allclose(corrected(rgb, saturation=2.0), 2 * rgb - grey, rtol=1e-5)
    np.testing.assert_allclose(corrected(rgb, gamma=2.0), np.sign(rgb) * np.sqrt(np.abs(rgb)), rtol=1e-5)


def test_temperature_keeps_the_luminance_of_white_and_warms_below_6500():
    warm = corrected((1.0, 1.0, 1.0), temperature=3200.0)
    assert warm[0] > 1.2 > warm[1] > warm[2]
    np.testing.assert_allclose(warm @ np.float32([0.2126, 0.7152, 0.0722]), 1.0, atol=0.02)
    np.testing.assert_allclose(corrected((1.0, 1.0, 1.0), temperature=6500.0), 1.0)


def test_a_matte_layer_limits_a_correction():
    layers = {"beauty": np.ones((1, 3, 4), np.float32), "rocks": np.float32([[[0.0], [0.5], [1.0]]])}
    recipe = {"mattes": {"rocks": {"layer": "rocks", "exposure": 1.0}}}
    assert fz.grade(fz.Film(layers), recipe)["beauty"][0, :, 0].tolist() == [1.0, 1.5, 2.0]
    recipe["mattes"]["rocks"]["invert"] = True
    assert fz.grade(fz.Film(layers), recipe)["beauty"][0, :, 0].tolist() == [2.0, 1.5, 1.0]


# ---- command ---------------------------------------------------------------------------------------------------------


def test_the_command_writes_exr_and_png(tmp_path, file, capsys):
    from frazil.cli import main

    recipe = tmp_path / "r.toml"
    recipe.write_text("[lights.key]\nintensity = 0.5\ncolour = [1.0, 0.5, 0.25]\n[lights.key.specular]\nsign = -1\n")
    for name in ("out.exr", "out.png"):
        assert main(["grade", str(file), "-r", str(recipe), "-o", str(tmp_path / name)]) == 0
        assert f"wrote {tmp_path / name}" in capsys.readouterr().out
    graded = fz.Film.load(tmp_path / "out.exr")
    assert "diffuse" not in graded
    np.testing.assert_allclose(graded["beauty"], fz.grade(file, recipe)["beauty"], rtol=2**-10, atol=1e-6)
    assert graded.metadata["frazil:recipe"] == recipe.read_text()
    recipe.write_text("[lights.kex]\nintensity = 0.5\n")
    assert main(["grade", str(file), "-r", str(recipe), "-o", str(tmp_path / "b.exr")]) == 1
    assert "got 'kex'" in capsys.readouterr().err
    assert main(["grade", str(file), "-r", str(recipe), "-o", str(tmp_path / "b.jpg")]) == 2
    assert not (tmp_path / "b.exr").exists()


@pytest.mark.parametrize("mode", [*MODES, "depth"])
def test_a_film_tells_the_compensation_that_it_was_rendered_with(mode):
    rendered = json.loads(render(mode=mode, bounces=0, samples=1).metadata["frazil:compensation"])
    assert [row["mode"] for row in rendered] == [mode]
