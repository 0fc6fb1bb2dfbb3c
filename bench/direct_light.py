"""Direct light against Mitsuba 3, pixel by pixel: floor, ball and wall of one diffuse material, each light in turn.

    pip install mitsuba; python bench/direct_light.py [--samples N] [--out DIR]

Both renderers make several pictures with other seeds. The difference of their means over its standard error is a normal
deviate where nothing but noise divides them: its root mean square should be 1, and the ratio of all light too.
UsdPreviewSurface's diffuse lobe leaves out what its clear surface reflects; Mitsuba is given the same formula.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import frazil as fz

kWidth, kHeight, kRuns = 48, 36, 6
kFov = 40.0  # degrees, across
kEye, kTarget = np.array([0.0, 2.0, 6.0]), np.array([0.0, 0.6, 0.0])
kColor = (0.8, 0.6, 0.4)


def frame(position, target) -> np.ndarray:
    """A matrix for row vectors whose -z looks from `position` to `target`."""
    z = np.subtract(position, target)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.99 else [0.0, 0.0, -1.0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[0, :3], matrix[1, :3], matrix[2, :3], matrix[3, :3] = x, np.cross(z, x), z, position
    return matrix


def ball(center, radius: float, rows: int = 64) -> tuple[np.ndarray, np.ndarray]:
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, 2 * rows + 1)[None, :]
    shape = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) * np.ones_like(phi), np.sin(theta) * np.sin(phi)], 2)
    index = np.arange((rows + 1) * (2 * rows + 1)).reshape(rows + 1, -1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    return shape.reshape(-1, 3) * radius + center, faces


def surfaces() -> list[tuple[np.ndarray, np.ndarray]]:
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    floor = np.array([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]], float)
    wall = np.array([[-1.6, 0, -1.5], [-0.4, 0, -1.5], [-0.4, 1.2, -1.5], [-1.6, 1.2, -1.5]], float)
    return [(floor, quad), (wall, quad), ball((0.3, 0.6, 0.0), 0.6)]


def sky(width: int = 512) -> np.ndarray:
    y, x = np.mgrid[: width // 2, :width]
    up, around = np.cos(np.pi * (y + 0.5) / (width // 2)), 2 * np.pi * (x + 0.5) / width
    image = np.full((width // 2, width, 3), 0.1)
    image += np.clip(up, 0, 1)[..., None] * np.array([0.3, 0.5, 1.0])
    sun = np.exp(-((up - 0.5) ** 2 * 60 + (np.cos(around - 2.0) - 1) ** 2 * 40)) * (np.cos(around - 2.0) > 0)
    return (image + sun[..., None] * np.array([20.0, 16.0, 10.0])).astype(np.float32)


def lights() -> dict:
    """Light by name: ours, and Mitsuba's entry as a function of `mi`."""
    at, target = (1.5, 2.5, 1.5), (0.0, 0.3, 0.0)
    place = frame(at, target)
    moved = np.eye(4)
    moved[3, :3] = at
    down = frame((0.4, 1.0, 0.5), (0.0, 0.0, 0.0))

    def area(mi, shape: str, turn, scale, radiance, **more):
        # Mitsuba's rectangle and disk face +z, its shapes are unit ones.
        matrix = np.diag([*scale, 1.0]) @ turn @ place
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": [radiance] * 3}}
        return {"type": shape, "to_world": mi.ScalarTransform4f(matrix.T), "emitter": emitter, **more}

    flip = np.diag([-1.0, 1.0, -1.0, 1.0])
    # Mitsuba's cylinder stands on z from 0 to 1, ours lies along x about its middle.
    lie = np.array([[0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0], [-0.5, 0, 0, 1]], float)

    def cylinder(mi):
        matrix = lie @ np.diag([1.2, 0.1, 0.1, 1.0]) @ place
        emitter = {"type": "area", "radiance": {"type": "rgb", "value": [12.0] * 3}}
        return {"type": "cylinder", "to_world": mi.ScalarTransform4f(matrix.T), "emitter": emitter}

    def dome(mi):
        return {"type": "envmap", "bitmap": mi.Bitmap(sky())}

    return {
        "distant": (
            fz.Light(fz.DistantLight(0.0), radiance=[2.0] * 3, matrix=down),
            lambda mi: {"type": "directional", "direction": (-down[2, :3]).tolist(),
                        "irradiance": {"type": "rgb", "value": [2.0] * 3}},
        ),
        "rect": (fz.Light(fz.RectLight(1.0, 0.6), radiance=[8.0] * 3, matrix=place),
                 lambda mi: area(mi, "rectangle", flip, (0.5, 0.3, 1.0), 8.0)),
        "disk": (fz.Light(fz.DiskLight(0.5), radiance=[8.0] * 3, matrix=place),
                 lambda mi: area(mi, "disk", flip, (0.5, 0.5, 1.0), 8.0)),
        "sphere": (fz.Light(fz.SphereLight(0.3), radiance=[12.0] * 3, matrix=moved),
                   lambda mi: {"type": "sphere", "center": list(at), "radius": 0.3,
                               "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [12.0] * 3}}}),
        "cylinder": (fz.Light(fz.CylinderLight(1.2, 0.1), radiance=[12.0] * 3, matrix=place), cylinder),
        "dome": (fz.Light(fz.DomeLight(sky(), "/sky")), dome),
        "uniform dome": (fz.Light(fz.DomeLight()),
                         lambda mi: {"type": "constant", "radiance": {"type": "rgb", "value": [1.0] * 3}}),
    }  # fmt: skip


def frazil_pictures(light: fz.Light, samples: int) -> np.ndarray:
    scene = fz.Scene()
    grey = scene.add_material(
        "/grey", fz.StandardMaterial(diffuse_color=kColor, use_specular_workflow=True, roughness=0.0, ior=1.0)
    )
    for i, (positions, faces) in enumerate(surfaces()):
        mesh = fz.Mesh(positions.astype(np.float32), faces.astype(np.int32))
        scene.add_object(f"/{i}", scene.add_mesh(mesh, f"/{i}"), grey, np.eye(4))
    scene.add_light(light)
    aperture = 2 * 50 * np.tan(np.radians(kFov / 2))
    scene.camera = fz.Camera(
        matrix=frame(kEye, kTarget),
        focal_length=50,
        horizontal_aperture=aperture,
        vertical_aperture=aperture * kHeight / kWidth,
    )
    films = [
        fz.render(scene, resolution=(kWidth, kHeight), samples=samples, pixel_filter="box", max_bounces=0, seed=run)
        for run in range(kRuns)
    ]
    return np.stack([film["diffuse"] for film in films])


def register_diffuse(mi) -> None:
    import drjit as dr

    class PreviewDiffuse(mi.BSDF):
        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
            self.m_components = [flags]
            self.m_flags = flags

        def value(self, si, wo):
            def enters(c):
                return 1.0 - (1.0 - dr.clip(c, 0.0, 1.0)) ** 5

            shape = enters(mi.Frame3f.cos_theta(si.wi)) * enters(mi.Frame3f.cos_theta(wo)) * (21.0 / 20.0)
            return mi.Color3f(*kColor) * shape * mi.Frame3f.cos_theta(wo) / dr.pi

        def is_front(self, si, wo):
            return (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)

        def sample(self, ctx, si, sample1, sample2, active=True):
            wo = mi.warp.square_to_cosine_hemisphere(sample2)
            bs = mi.BSDFSample3f()
            bs.wo, bs.pdf, bs.eta = wo, mi.warp.square_to_cosine_hemisphere_pdf(wo), 1.0
            bs.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
            bs.sampled_component = mi.UInt32(0)
            good = active & self.is_front(si, wo) & (bs.pdf > 0)
            return bs, dr.select(good, self.value(si, wo) / bs.pdf, mi.Color3f(0.0))

        def eval(self, ctx, si, wo, active=True):
            return dr.select(active & self.is_front(si, wo), self.value(si, wo), mi.Color3f(0.0))

        def pdf(self, ctx, si, wo, active=True):
            pdf = mi.warp.square_to_cosine_hemisphere_pdf(wo)
            return dr.select(active & self.is_front(si, wo), pdf, 0.0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    mi.register_bsdf("preview_diffuse", PreviewDiffuse)


def mitsuba_pictures(light, samples: int) -> np.ndarray:
    import mitsuba as mi

    scene = {
        "type": "scene",
        "integrator": {"type": "direct", "hide_emitters": True},
        "sensor": {
            "type": "perspective",
            "fov": kFov,
            "to_world": mi.ScalarTransform4f().look_at(kEye.tolist(), kTarget.tolist(), [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": kWidth, "height": kHeight, "pixel_format": "rgb",
                     "component_format": "float32", "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": samples},
        },
        "light": light(mi),
    }  # fmt: skip
    for i, (positions, faces) in enumerate(surfaces()):
        props = mi.Properties()
        props["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": {"type": "preview_diffuse"}})
        mesh = mi.Mesh(f"mesh{i}", len(positions), len(faces), props=props)
        params = mi.traverse(mesh)
        params["vertex_positions"] = np.ravel(positions).astype(np.float32)
        params["faces"] = np.ravel(faces).astype(np.uint32)
        params.update()
        scene[f"mesh{i}"] = mesh
    loaded = mi.load_dict(scene)
    return np.stack([np.array(mi.render(loaded, seed=run)) for run in range(kRuns)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=32, help="a picture, of which there are six")
    parser.add_argument("--out", type=Path, help="folder for pictures of both and their deviates")
    options = parser.parse_args()
    import mitsuba as mi

    # Dr.Jit's vectors need a newer LLVM than Debian 12 has.
    mi.set_variant("scalar_rgb")
    register_diffuse(mi)
    print(f"{'light':14} {'ratio':>8} {'rms z':>7} {'|z| > 4':>8}   of {kWidth * kHeight} pixels, luminance")
    for name, (ours, theirs) in lights().items():
        pictures = [frazil_pictures(ours, options.samples), mitsuba_pictures(theirs, options.samples)]
        luminance = [p @ np.array([0.2126, 0.7152, 0.0722]) for p in pictures]
        means = [p.mean(0) for p in luminance]
        # Of six pictures each; neighbours share their variance, which steadies it.
        variance = sum(smooth(p.var(0, ddof=1)) / kRuns for p in luminance)
        lit = (means[0] + means[1] > 1e-3) & (variance > 0)
        z = (means[0] - means[1])[lit] / np.sqrt(variance[lit] + (1e-5 * means[1][lit]) ** 2)
        ratio = means[0].sum() / means[1].sum()
        print(f"{name:14} {ratio:8.4f} {np.sqrt(np.mean(z**2)):7.3f} {(np.abs(z) > 4).mean():8.4%}", flush=True)
        if options.out:
            options.out.mkdir(parents=True, exist_ok=True)
            for label, picture in zip(("frazil", "mitsuba"), pictures, strict=True):
                np.save(options.out / f"{name.replace(' ', '_')}_{label}.npy", picture.mean(0))


def smooth(x: np.ndarray) -> np.ndarray:
    padded = np.pad(x, 1, mode="edge")
    return sum(padded[j : j + x.shape[0], i : i + x.shape[1]] for j in range(3) for i in range(3)) / 9


if __name__ == "__main__":
    main()
