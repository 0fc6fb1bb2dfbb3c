"""Render vars whose source is a light path expression, from the stage to the EXR."""

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender
from usd_stages import add_quad, new_stage

import frazil as fz
from frazil.cli import main


def stage_with(path, expressions):
    stage = new_stage(path)
    add_quad(stage, "/Quad")
    stage.GetPrimAtPath("/Dome").CreateAttribute("frazil:lightGroup", Sdf.ValueTypeNames.String).Set("sky")
    camera = stage.GetPrimAtPath("/Camera")
    UsdGeom.Xformable(camera).AddTranslateOp().Set(Gf.Vec3d(0.5, 0.5, 3))
    settings = UsdRender.Settings.Define(stage, "/Render/Settings")
    product = UsdRender.Product.Define(stage, "/Render/Product")
    settings.CreateProductsRel().AddTarget(product.GetPath())
    stage.SetMetadata("renderSettingsPrimPath", "/Render/Settings")
    names = {"beauty": None, **expressions}
    for name, expression in names.items():
        var = UsdRender.Var.Define(stage, f"/Render/{name}")
        var.CreateSourceNameAttr(expression or "beauty")
        if expression:
            var.CreateSourceTypeAttr(UsdRender.Tokens.lpe)
        product.CreateOrderedVarsRel().AddTarget(var.GetPath())
    stage.Save()
    return path


def test_render_vars_of_lpes_are_layers(tmp_path):
    path = stage_with(tmp_path / "a.usda", {"sky_on_diffuse": "C<RD>.*<L.'sky'>", "all": "C.*", "none": "CV.*"})
    assert main(["render", str(path), "-o", str(tmp_path / "a.exr"), "--resolution", "16x16", "--samples", "2"]) == 0
    film = fz.Film.load(tmp_path / "a.exr")
    assert {"beauty", "sky_on_diffuse", "all", "none"} <= set(film)
    np.testing.assert_allclose(film["all"], film["beauty"][:, :, :3], rtol=2e-3, atol=1e-5)
    assert film["sky_on_diffuse"].max() > 0.01
    assert not film["none"].any()


def test_render_vars_of_occlusion_are_layers(tmp_path):
    path = stage_with(tmp_path / "o.usda", {})
    stage = Usd.Stage.Open(str(path))
    product = UsdRender.Product(stage.GetPrimAtPath("/Render/Product"))
    for name in ("occlusion", "bent_normal"):
        var = UsdRender.Var.Define(stage, f"/Render/{name}")
        var.CreateSourceNameAttr(name)
        product.CreateOrderedVarsRel().AddTarget(var.GetPath())
    stage.Save()
    assert main(["render", str(path), "-o", str(tmp_path / "o.exr"), "--resolution", "16x16", "--samples", "4"]) == 0
    film = fz.Film.load(tmp_path / "o.exr")
    assert {"beauty", "occlusion", "bent_normal"} <= set(film)
    # A quad with nothing around is open, and open along its normal.
    seen = film["beauty"][:, :, 3] == 1
    assert seen.any()
    np.testing.assert_allclose(film["occlusion"][seen], 1.0, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(film["bent_normal"][seen], axis=1), 1.0, atol=2e-3)
    assert film["bent_normal"][seen].mean(axis=0)[2] > 0.95


def test_a_wrong_lpe_of_a_stage_names_itself_and_the_place(tmp_path, capsys):
    path = stage_with(tmp_path / "b.usda", {"wrong": "C<TD.*"})
    assert main(["render", str(path), "-o", str(tmp_path / "b.exr"), "--resolution", "8x8", "--samples", "1"]) == 1
    said = capsys.readouterr().err
    assert "lpe wrong" in said
    assert "character" in said
    assert not (tmp_path / "b.exr").exists()
