"""Small MaterialX documents that tests write, and how they are bound to a quad."""

from pxr import UsdShade
from usd_stages import add_quad, load

OUTG = 'output="outg"'
HEAD = '<?xml version="1.0"?>\n<materialx version="1.39" colorspace="lin_rec709">\n'


def model_of(scene, number=0):
    return scene.materials[scene.objects[number].material].model


def refer(stage, tmp_path, body, name="Look", head=HEAD):
    """Bind a quad to a material of a .mtlx file, by reference."""
    (tmp_path / "looks.mtlx").write_text(f"{head}{body}</materialx>\n", encoding="utf-8")
    quad = add_quad(stage, "/Quad")
    material = UsdShade.Material.Define(stage, "/Looks/Mine")
    material.GetPrim().GetReferences().AddReference("./looks.mtlx", f"/MaterialX/Materials/{name}")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    scene = load(stage)
    return model_of(scene), scene.warnings


def surface(kind, inputs, more="", extra=""):
    return f"""{more}
  <{kind} name="shader" type="surfaceshader">{inputs}</{kind}>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="shader" />{extra}
  </surfacematerial>
"""


def value(name, kind, text, more=""):
    return f'<input name="{name}" type="{kind}" value="{text}" {more}/>'


def colored(node, graph):
    """A surface whose base color that node of a graph feeds."""
    return surface("standard_surface", value("base", "float", "1") + fed("base_color", "color3", node), graph)


def image(name, file, kind="color3", more="", space=""):
    space = f'colorspace="{space}" ' if space else ""
    return (
        f'<image name="{name}" type="{kind}"><input name="file" type="filename" value="{file}" {space}/>{more}</image>'
    )


def fed(name, kind, node, output=""):
    return f'<input name="{name}" type="{kind}" nodename="{node}" {output}/>'
