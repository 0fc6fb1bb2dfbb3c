"""Light path expressions: what they keep against the layers of the film, and where a wrong one is wrong."""

import numpy as np
import pytest
import test_grading as ice

import frazil as fz

OPTIONS = {"resolution": (24, 20), "samples": 4, "bake_samples": 4, "bake_bounces": 0}


def render(lpes, **options):
    return fz.render(ice.scene(), lpes=lpes, **(OPTIONS | options))


@pytest.fixture(scope="module")
def film():
    return render(
        {
            "everything": "C.*",
            "ice": "C<TD>.*",
            "ice_of_rim": "C<TD>.*<L.'rim'>",
            "first_diffuse": "C<RD>.*",
            "first_glossy": "C<RG>.*",
            "sky_seen": "CB",
            "glow": "CO",
            "through_ice": "C<TG>.*",
            "floor_by_key": "C<RD.'/World/Floor'><L.'key'>",
            "direct_key": "C<RD><L.'key'>",
            "two_or_more": "C.{2,}L",
            "one_only": "C.?[LBO]",
            "not_rim": "C.*<L.[^'rim']>",
            "rim": "C.*<L.'rim'>",
            "no_camera": "L.*",
        }
    )


def same(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=2e-4, atol=2e-5)


def test_all_paths_are_the_beauty(film):
    same(film["everything"], film["beauty"][:, :, :3])


def test_first_lobes_are_the_components(film):
    same(film["ice"], film["translucency"])
    same(film["first_diffuse"], film["diffuse"])
    same(film["first_glossy"], film["specular"])
    same(film["sky_seen"], film["background"])
    same(film["glow"], film["emission"])
    same(film["through_ice"], film["refraction"])


def test_labels_that_name_nothing_are_named():
    with pytest.warns(fz.FrazilWarning, match=r"lpe a: label must be a light group \(.*key.*got 'kee'.*mean 'key'"):
        film = render({"a": "C.*<L.'kee'>", "b": "C<RD.'diffuse'>.*"}, resolution=(4, 4), samples=1, bake_samples=1)
    assert not film["a"].any()


def test_labels_are_light_groups_and_objects(film):
    same(film["ice_of_rim"], film["translucency_rim"])
    rim = sum(film[f"{name}_rim"] for name in ice.COMPONENTS)
    same(film["rim"], rim)
    assert 0 < film["floor_by_key"].sum() <= film["direct_key"].sum()
    assert np.all(film["direct_key"] <= film["diffuse_key"] + 1e-4)


def test_an_expression_that_no_path_fits_is_black(film):
    assert not film["no_camera"].any()


def test_the_picture_is_the_same_with_and_without(film):
    np.testing.assert_array_equal(film["beauty"], render({})["beauty"])


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        ("", "must not be empty, at character 1"),
        ("C<RD", "'>' is missing, at character 5 of 'C<RD'"),
        ("C<XD>", "a type must be one of CRTVLBO, got 'X', at character 3"),
        ("C<RX>", "a scattering must be one of DGSs, got 'X', at character 4"),
        ("CQ", "'Q' is no event: .*, at character 2"),
        ("C(RD", r"'\)' is missing, at character 5"),
        ("CR)", r"'\)' has no '\(' before it, at character 3"),
        ("C*|", "an event is missing, at character 4"),
        ("*", r"'\*' is no event"),
        ("C{2", "'}' is missing"),
        ("C{3,2}", "the most must not be less than the least"),
        ("C{99}", "must be at most 32"),
        ("C<L.'rim>", "the quote that closes the label is missing, at character 5"),
        ("C<L.rim>", "a label must be in quotes"),
    ],
)
def test_a_wrong_expression_is_refused_with_the_place(expression, message):
    with pytest.raises(ValueError, match=r"lpe bad: .*" + message):
        render({"bad": expression})


def test_names_must_be_free(film):
    for name, message in (
        ("beauty", "name must not be"),
        ("diffuse_x", "begin like, that of the AOV diffuse"),
        ("a.b", "letters, digits and _"),
    ):
        with pytest.raises(ValueError, match=message):
            render({name: "C.*"})
