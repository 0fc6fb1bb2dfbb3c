"""Single scattering against Mitsuba 3 (volpath, depth 2): a sphere of index-matched, cloudy ice under two lights, of
one density and of a grid of 12 x 12 x 12 random ones.

    pip install mitsuba; python bench/single_scattering.py

Prints the mean of the `volume` layer over the sphere, Mitsuba's, and their ratio, per channel; and the largest
difference between means over a sixteenth of the picture that the sphere fills, in parts of the mean.
"""

import sys

import numpy as np

import frazil as fz

kSigmaS, kSigmaA = np.array([4.0, 2.0, 1.0]), np.array([0.5, 1.0, 0.1])
kSize, kSamples = 32, 1024
kLamp = (0.4, 1.7, 0.9)  # outside the sphere
kDensities = np.random.default_rng(3).uniform(0.0, 2.0, (12, 12, 12)).astype(np.float32) ** 2
kFov = 24.0  # degrees; the camera stands 6 m away and the sphere has radius 1


def mitsuba_picture(light: dict, g: float, is_grid: bool) -> np.ndarray:
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "llvm_ad_rgb" in mi.variants() and "--llvm" in sys.argv else "scalar_rgb")
    sigma_t = kSigmaS + kSigmaA
    albedo = {"type": "rgb", "value": (kSigmaS / sigma_t).tolist()}
    medium = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": (sigma_t / 5).tolist()},
        "scale": 5.0,
        "albedo": albedo,
    }
    if is_grid:
        # Texels are cells there, whose corners span the box; here they are the lattice's corners.
        n = len(kDensities)
        data = (kDensities.transpose(2, 1, 0)[..., None] * sigma_t).astype(np.float32)
        half = n / (n - 1)
        box = mi.ScalarTransform4f().translate([-half] * 3) @ mi.ScalarTransform4f().scale(2 * half)
        grid = mi.VolumeGrid(data)
        medium = {
            "type": "heterogeneous",
            "sigma_t": {"type": "gridvolume", "grid": grid, "to_world": box, "raw": True, "filter_type": "trilinear"},
            "albedo": {"type": "constvolume", "value": albedo},
        }
    scene = {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 2, "rr_depth": 99},
        "sensor": {
            "type": "perspective",
            "fov": kFov,
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 6], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": kSize, "height": kSize, "pixel_format": "rgb",
                     "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": kSamples},
        },
        "ice": {
            "type": "sphere",
            "bsdf": {"type": "null"},
            "interior": medium | {"phase": {"type": "hg", "g": g}},
        },
        "light": light,
    }  # fmt: skip
    return np.array(mi.render(mi.load_dict(scene)))


def within_sphere() -> np.ndarray:
    """The pixels that the sphere fills."""
    y, x = np.mgrid[:kSize, :kSize] + 0.5 - kSize / 2
    radius = np.tan(np.arcsin(1 / 6)) / np.tan(np.radians(kFov / 2)) * kSize / 2
    return np.hypot(x, y) < radius - 2


def blocks(image: np.ndarray) -> np.ndarray:
    """Means over 4 x 4 blocks of the picture within the sphere."""
    where = within_sphere()
    step = kSize // 4
    parts = [(y, x) for y in range(0, kSize, step) for x in range(0, kSize, step)]
    cut = [(slice(y, y + step), slice(x, x + step)) for y, x in parts]
    return np.array([image[part][where[part]].mean(0) for part in cut if where[part].all()])


def icosphere(levels: int) -> fz.Mesh:
    positions = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    faces = np.array(faces)
    for _ in range(levels):
        corners = positions[faces]
        middle = (corners + np.roll(corners, -1, 1)) / 2
        middle /= np.linalg.norm(middle, axis=2, keepdims=True)
        every = np.concatenate([corners, middle], 1).reshape(-1, 3)
        positions, index = np.unique(every.round(9), axis=0, return_inverse=True)
        a, b, c, ab, bc, ca = index.reshape(-1, 6).T
        faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return fz.Mesh(positions.astype(np.float32), faces.astype(np.int32))


def frazil_picture(light: fz.Light, g: float, is_grid: bool) -> np.ndarray:
    scene = fz.Scene()
    medium = fz.Medium(tuple(kSigmaS), tuple(kSigmaA), 1.0)
    corners = np.diag([2 / (len(kDensities) - 1)] * 3 + [1.0])
    corners[3, :3] = -1.0
    density = fz.Density(kDensities, corners) if is_grid else fz.Density()
    ice = fz.IceMaterial(medium, roughness=0.0, translucency=0.0, volume=1.0, anisotropy=g, density=density)
    scene.add_object("/ice", scene.add_mesh(icosphere(6), "/ice"), scene.add_material("/ice", ice), np.eye(4))
    scene.add_light(light)
    matrix = np.eye(4)
    matrix[3, 2] = 6.0
    aperture = 2 * 50 * np.tan(np.radians(kFov / 2))
    scene.camera = fz.Camera(matrix=matrix, focal_length=50, horizontal_aperture=aperture, vertical_aperture=aperture)
    film = fz.render(
        scene, resolution=(kSize, kSize), samples=kSamples, pixel_filter="box", bake_samples=1, spacing=0.2
    )
    return film["volume"]


def main() -> None:
    down = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)  # -z of the light is -y
    lamp = np.eye(4)
    lamp[3, :3] = kLamp
    lights = {
        "sun from above": (
            fz.Light(fz.DistantLight(0.0), radiance=(3, 3, 3), matrix=down),
            {"type": "directional", "direction": [0, -1, 0], "irradiance": {"type": "rgb", "value": [3, 3, 3]}},
        ),
        "lamp beside": (
            fz.Light(fz.SphereLight(0.2), radiance=(40, 40, 40), matrix=lamp),
            {"type": "sphere", "center": list(kLamp), "radius": 0.2,
             "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [40, 40, 40]}}},
        ),
    }  # fmt: skip
    where = within_sphere()
    for name, (ours, theirs) in lights.items():
        for is_grid, g in ((False, 0.0), (False, 0.6), (True, 0.0), (True, 0.6)):
            a, b = frazil_picture(ours, g, is_grid), mitsuba_picture(theirs, g, is_grid)
            off = np.abs(blocks(a) - blocks(b)).max(0) / b[where].mean(0)
            a, b = a[where].mean(0), b[where].mean(0)
            kind = "grid" if is_grid else "even"
            print(
                f"{name}, {kind}, g {g}: frazil {a.round(5)} mitsuba {b.round(5)} ratio {(a / b).round(4)} "
                f"blocks {off.round(4)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
