"""What is fuzzed: every reader of files and arrays, with seeds that the project makes itself.

Model: a target takes bytes (or arrays) and either answers or refuses with one of the errors that its documentation
names. Anything else - another error, a crash, a hang - is a finding.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

import frazil as fz

USDA = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
    startTimeCode = 1
    endTimeCode = 2
)
def Xform "World"
{
    def Mesh "Ice" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [4, 4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 3, 2, 5, 4, 0, 1, 4]
        point3f[] points = [(0, 0, 0), (100, 0, 0), (100, 100, 0), (0, 100, 0), (0, 100, 50), (100, 100, 50)]
        point3f[] points.timeSamples = {
            1: [(0, 0, 0), (100, 0, 0), (100, 100, 0), (0, 100, 0), (0, 100, 50), (9, 9, 9)],
        }
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        color3f[] primvars:displayColor = [(0.2, 0.3, 0.4)]
        int[] primvars:st:indices = [0, 1, 2, 3, 0, 1]
        uniform token subdivisionScheme = "catmullClark"
        int[] creaseIndices = [0, 1]
        int[] creaseLengths = [2]
        float[] creaseSharpnesses = [3]
        rel material:binding = </World/Looks/Ice>
        float xformOp:rotateY = 10
        double3 xformOp:translate = (0, 1, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
        def GeomSubset "Part"
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0, 2]
        }
    }
    def Sphere "Ball"
    {
        double radius = 20
    }
    def PointInstancer "Crowd"
    {
        int[] protoIndices = [0, 0]
        point3f[] positions = [(1, 2, 3), (4, 5, 6)]
        quath[] orientations = [(1, 0, 0, 0), (0.5, 0.5, 0.5, 0.5)]
        float3[] scales = [(1, 1, 1), (2, 2, 2)]
        rel prototypes = [</World/Crowd/One>]
        def Cube "One"
        {
            double size = 3
        }
    }
    def Scope "Looks"
    {
        def Material "Ice"
        {
            token outputs:frazil:surface.connect = </World/Looks/Ice/Shader.outputs:surface>
            token outputs:surface.connect = </World/Looks/Ice/Shader.outputs:surface>
            def Shader "Shader"
            {
                uniform token info:id = "frazil:ice"
                color3f inputs:albedo = (0.7, 0.8, 0.9)
                color3f inputs:mean_free_path = (1, 2, 3)
                float[] inputs:ramp_distances = [0, 1]
                color3f[] inputs:ramp_colors = [(1, 1, 1), (0, 0, 1)]
                float inputs:age = 0.5
                token inputs:overlays:cracks.connect = </World/Looks/Ice/Cracks.outputs:out>
                token outputs:surface
            }
            def Shader "Cracks"
            {
                uniform token info:id = "frazil:overlay"
                token inputs:pattern = "cells"
                float inputs:opacity = 0.5
                token outputs:out
            }
        }
    }
    def RectLight "Key"
    {
        float inputs:intensity = 3
        color3f inputs:color = (1, 0.5, 0.2)
        string frazil:lightGroup = "key"
    }
    def DomeLight "Sky"
    {
        float inputs:intensity = 1
        asset inputs:texture:file = @none.exr@
    }
    def Camera "Camera"
    {
        float focalLength = 30
        float2 clippingRange = (1, 1000)
    }
}
def RenderSettings "Settings"
{
    uniform int2 resolution = (64, 32)
    rel camera = </World/Camera>
    rel products = </Product>
}
def RenderProduct "Product"
{
    rel orderedVars = </Var>
}
def RenderVar "Var"
{
    string sourceName = "C<TD>.*"
    uniform token sourceType = "lpe"
}
"""

OBJ = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/1\nf 1 3 4\nf -1 -2 -3\n"
RECIPE = """[lights.key]
intensity = 0.5
color = [1.0, 0.9, 0.8]
sign = -1
[lights.rim.translucency]
exposure = 1.5
[components.specular]
intensity = 0.7
[ramp]
colors = [[1, 1, 1], [0.3, 0.8, 1.0]]
preserve_energy = true
[overlays]
age = 0.3
[overlays.frost]
opacity = 0.5
[color]
temperature = 5600
gamma = [1.0, 1.1, 1.2]
[mattes.rocks]
objects = ["/World/Rocks*"]
invert = true
"""


@dataclass
class Target:
    """One reader: what it is given, what it may refuse with, and what it does."""

    strategy: st.SearchStrategy
    run: Callable[[object, Path], object]
    refusals: tuple[type[BaseException], ...]


def edits(seed: bytes) -> st.SearchStrategy[bytes]:
    """The seed with some pieces overwritten, cut out, repeated or put in."""
    place = st.integers(0, max(0, len(seed) - 1))
    piece = st.one_of(
        st.binary(max_size=8),
        st.sampled_from([b"\x00" * 4, b"\xff" * 4, b"\x7f\xff\xff\xff", b"-1", b"1e39", b"nan", b"9" * 20, b"[", b"]"]),
    )
    edit = st.tuples(st.sampled_from(["set", "cut", "repeat", "insert", "end"]), place, st.integers(1, 64), piece)

    def apply(steps: list[tuple[str, int, int, bytes]]) -> bytes:
        content = seed
        for kind, at, length, new in steps:
            if kind == "set":
                content = content[:at] + new + content[at + len(new) :]
            elif kind == "cut":
                content = content[:at] + content[at + length :]
            elif kind == "repeat":
                content = content[:at] + content[at : at + length] * 2 + content[at + length :]
            elif kind == "insert":
                content = content[:at] + new + content[at:]
            elif at * 8 > len(seed):
                content = content[:at]
        return content

    return st.lists(edit, min_size=1, max_size=6).map(apply)


def tokens(text: str) -> st.SearchStrategy[bytes]:
    """The text with some of its words exchanged for others of it or for odd ones."""
    import re

    words = re.findall(r"[A-Za-z_:]+|-?[\d.]+|\s+|.", text)
    choices = sorted({w for w in words if not w.isspace()})
    odd = [
        "-1",
        "0",
        "1e38",
        "-1e38",
        "nan",
        "inf",
        "1e-40",
        "99999999999",
        '""',
        "[]",
        "()",
        "true",
        "None",
        "@@",
        "</>",
    ]
    exchange = st.tuples(st.integers(0, len(words) - 1), st.sampled_from(choices + odd))

    def apply(steps: list[tuple[int, str]]) -> bytes:
        changed = list(words)
        for at, word in steps:
            changed[at] = word
        return "".join(changed).encode()

    return st.lists(exchange, min_size=1, max_size=8).map(apply)


def _written(content: bytes, path: Path) -> Path:
    path.write_bytes(content)
    return path


def _film(folder: Path) -> fz.Film:
    random = np.random.default_rng(1)
    layers = {"beauty": random.random((6, 8, 4), np.float32), "translucency": random.random((6, 8, 3), np.float32)}
    return fz.Film(layers | {"Z": random.random((6, 8, 1), np.float32)}, {"frazil:light_groups": ["key", "rim"]})


def _exr(folder: Path, **options) -> bytes:
    _film(folder).save(folder / "seed.exr", **options)
    return (folder / "seed.exr").read_bytes()


def _png(folder: Path) -> bytes:
    _film(folder).save_preview(folder / "seed.png")
    return (folder / "seed.png").read_bytes()


def _quad() -> fz.Mesh:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    return fz.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def _scene(mesh: fz.Mesh | None = None, **look) -> fz.Scene:
    scene = fz.Scene()
    ice = fz.IceMaterial(fz.Medium(sigma_s_prime=(9.0, 9.0, 9.0), sigma_a=(0.1, 0.1, 0.1)), **look)
    scene.add_object("/Ice", scene.add_mesh(mesh or _quad(), "/Ice"), scene.add_material("/Look", ice))
    scene.add_light(fz.Light(fz.DomeLight(), path="/Sky", group="sky"))
    camera = np.eye(4)
    camera[3, :3] = 0.5, 0.5, 3
    scene.camera = fz.Camera(matrix=camera)
    return scene


def _bake(folder: Path) -> bytes:
    fz.save_bake(fz.bake(_scene(), spacing=0.2, bake_samples=1, bake_bounces=0), folder / "seed.bake", _scene())
    return (folder / "seed.bake").read_bytes()


def _points(folder: Path) -> bytes:
    fz.poisson_points(_quad(), 0.3).save(folder / "seed.ply")
    return (folder / "seed.ply").read_bytes()


def _checkpoint(folder: Path) -> bytes:
    from frazil.checkpoint import Checkpoint

    Checkpoint(folder / "seed.checkpoint", _scene(), {}).save({"layer.beauty": np.ones(12, np.float32)})
    return (folder / "seed.checkpoint").read_bytes()


def _load_exr(content: object, folder: Path) -> None:
    film = fz.Film.load(_written(content, folder / "in.exr"))
    fz.grade(film, {"color": {"exposure": 1.0}})


def _load_checkpoint(content: object, folder: Path) -> None:
    from frazil.checkpoint import Checkpoint

    Checkpoint(_written(content, folder / "in.checkpoint"), _scene(), {}).load()


def _load_usd(content: object, folder: Path) -> None:
    scene = fz.load_usd(_written(content, folder / "in.usda"))
    fz.add_motion(scene)


def _load_mesh(content: object, folder: Path) -> None:
    from frazil.mesh_io import read_mesh

    fz.poisson_points(read_mesh(_written(content, folder / "in.obj")), 0.2, max_points=20_000)


def _arrays(arrays: object, folder: Path) -> None:
    """Points on any mesh, and a render of ice of that shape."""
    positions, triangles, spacing = arrays
    mesh = fz.Mesh(positions, triangles)
    fz.poisson_points(mesh, spacing, max_points=20_000)
    fz.render(_scene(mesh, spacing=spacing), resolution=(4, 4), samples=1, bake_samples=1, bake_bounces=1, threads=1)


def _render_lpe(text: object, folder: Path) -> None:
    fz.render(_scene(spacing=0.3), resolution=(2, 2), samples=1, bake_samples=1, bake_bounces=0, lpes={"x": text})


def _read_recipe(content: object, folder: Path) -> None:
    from frazil.grade_recipe import read_recipe

    fz.grade(_film(folder), read_recipe(_written(content, folder / "in.toml")))


def _read_picture(content: object, folder: Path) -> None:
    from frazil.image import read_picture

    read_picture(_written(content, folder / "in.png"))


def _shapes() -> st.SearchStrategy[tuple[np.ndarray, np.ndarray, float]]:
    number = st.one_of(
        st.floats(-2, 2, width=32),
        st.sampled_from([0.0, 1.0, 1e-30, 1e-6, 1e6, 1e30, float("inf"), float("nan"), -1.0]),
    )
    positions = st.lists(st.tuples(number, number, number), min_size=0, max_size=8)
    triangles = st.lists(st.tuples(*[st.integers(-1, 8)] * 3), min_size=0, max_size=10)
    return st.tuples(
        positions.map(lambda rows: np.array(rows, np.float32).reshape(-1, 3)),
        triangles.map(lambda rows: np.array(rows, np.int32).reshape(-1, 3)),
        st.sampled_from([0.1, 0.5, 2.0, 1e-9, 0.0, -1.0, float("nan")]),
    )


def make_targets(folder: Path) -> dict[str, Target]:
    """All targets by name; seeds are made in `folder`."""
    refused = (OSError, ValueError, KeyError, MemoryError)
    exr = [_exr(folder), _exr(folder, multipart=True), _exr(folder, compression="piz")]
    lpe = st.lists(
        st.sampled_from([*"CLDGRTVBO.*+?|()[]^<>'", "<TD>", "<L.'sky'>", "'/Ice'", "C", ".*", " ", "\\", "ä"]),
        max_size=12,
    ).map("".join)
    return {
        "usd": Target(st.one_of(tokens(USDA), edits(USDA.encode())), _load_usd, refused),
        "mesh": Target(st.one_of(tokens(OBJ.decode()), edits(OBJ)), _load_mesh, refused),
        "arrays": Target(_shapes(), _arrays, refused),
        "recipe": Target(st.one_of(tokens(RECIPE), edits(RECIPE.encode())), _read_recipe, refused),
        "lpe": Target(lpe, _render_lpe, refused),
        "exr": Target(st.one_of(*map(edits, exr)), _load_exr, refused),
        "picture": Target(edits(_png(folder)), _read_picture, refused),
        "bake": Target(edits(_bake(folder)), lambda c, f: fz.load_bake(_written(c, f / "in.bake")), refused),
        "points": Target(edits(_points(folder)), lambda c, f: fz.PointSet.load(_written(c, f / "in.ply")), refused),
        "checkpoint": Target(edits(_checkpoint(folder)), _load_checkpoint, refused),
    }


def run_quietly(target: Target, value: object, folder: Path) -> None:
    """Run a target once; refusals and warnings are fine."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            target.run(value, folder)
        except target.refusals as error:
            # The texts that users see: one line, naming what is wrong.
            if "\n" in str(error).strip():
                raise AssertionError(f"the message must be one line, got: {error}") from error
