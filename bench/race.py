"""Seconds to a picture of equal error: Frazil against Mitsuba 3 (volpath) and Cycles (random walk) on one body of ice.

    python bench/race.py [--sizes 96 192] [--spp 64] [--reference FILE.npz MESH.ply] [-o bench/results/race.json]

A cluster of ice spires (frazil.formations) with an index-matched boundary, under light from all around and a lamp, in
two media of different albedo; or with --reference the body, medium, lights and camera of a path-traced reference, as in
bench/truth.py. Mitsuba's volumetric paths are unbiased: the mean of its renders is the truth. Every
renderer runs twice, with two seeds, in a process of its own:

- noise: RMS of the two pictures' difference / sqrt(2), relative to the truth's RMS, over all channels of the pixels
  that the body fills;
- bias: RMS of the two pictures' mean less the truth, with what noise of both explains taken off (squares subtract);
- seconds to a noise: of Monte Carlo renderers time goes as noise^-2, and the table says from which noise it is scaled.
  Frazil's time is that of its run, mesh to picture, points and bake included.

Times are processor time over all threads (as other work disturbs the clock) and, beside, wall time. Cycles gets the
single-scattering albedo and mean free path of the medium, through the inverse of its own mapping; it scatters entering
light diffusely, so that an index-matched boundary is not its model: its bias shows that.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

MEDIA = {"bright": ([25.0] * 3, [0.1] * 3), "dark": ([25.0] * 3, [1.5] * 3)}  # sigma_s' and sigma_a, 1/m

COMMON = """
import json, resource, sys, time, numpy as np
job = json.loads(sys.argv[1])
mesh = np.load(job['mesh']); V, F = mesh['V'], mesh['F']
matrix = np.array(job['camera']); lamp = np.array(job['lamp'])  # row vectors, looking along -z
def highest():  # of this process; ru_maxrss would begin with that of its parent
    return next(int(line.split()[1]) * 1024 for line in open('/proc/self/status') if line.startswith('VmHWM'))
def finish(picture, start):
    usage = resource.getrusage(resource.RUSAGE_SELF)
    cpu = usage.ru_utime + usage.ru_stime - start[1]
    np.savez(job['out'], picture=np.float32(picture), wall=time.perf_counter() - start[0], cpu=cpu,
             peak=highest())
def clock():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return time.perf_counter(), usage.ru_utime + usage.ru_stime
"""
FRAZIL = (
    COMMON
    + """
import frazil as fz
def scene():
    s = fz.Scene()
    medium = fz.Medium(job['sigma_s'], job['sigma_a'], eta=1.0)
    ice = s.add_material('/ice', fz.IceMaterial(medium))
    s.add_object('/body', s.add_mesh(fz.Mesh(V, F), '/body'), ice)
    s.add_light(fz.Light(fz.DomeLight(), radiance=job['env'], path='/env'))
    square = fz.RectLight(job['width'], job['width'])
    s.add_light(fz.Light(square, radiance=[job['radiance']] * 3, matrix=lamp, path='/lamp'))
    aperture = 2 * 50.0 * np.tan(job['fov'] / 2)
    s.camera = fz.Camera(matrix=matrix, focal_length=50.0, horizontal_aperture=aperture, vertical_aperture=aperture)
    return s
start = clock()
film = fz.render(scene(), resolution=(job['size'],) * 2, samples=job['spp'], seed=job['seed'], threads=job['threads'],
                 spacing_scale=job['spacing_scale'],
                 pixel_filter='box')
finish(film['beauty'], start)
"""
)
MITSUBA = (
    COMMON
    + """
import mitsuba as mi
mi.set_variant(job['variant'])
body = mi.Mesh('body', len(V), len(F)); params = mi.traverse(body)
params['vertex_positions'] = V.ravel(); params['faces'] = F.ravel(); params.update()
body.write_ply(job['out'] + '.ply')
def transform(m): return mi.ScalarTransform4f(m.T)
flip = np.diag([-1.0, 1.0, -1.0, 1.0])  # Mitsuba's cameras and rectangles look along +z
total = np.add(job['sigma_s'], job['sigma_a']); most = float(total.max())
half = np.diag([job['width'] / 2, job['width'] / 2, 1.0, 1.0])
scene = mi.load_dict({'type': 'scene',
    'integrator': {'type': 'volpath', 'max_depth': -1, 'rr_depth': 1 << 20},
    'sensor': {'type': 'perspective', 'fov': float(np.degrees(job['fov'])), 'to_world': transform(flip @ matrix),
        'film': {'type': 'hdrfilm', 'width': job['size'], 'height': job['size'], 'rfilter': {'type': 'box'},
                 'pixel_format': 'rgb', 'component_format': 'float32'},
        'sampler': {'type': 'independent', 'sample_count': job['spp'], 'seed': job['seed']}},
    'env': {'type': 'constant', 'radiance': {'type': 'rgb', 'value': job['env']}},
    'lamp': {'type': 'rectangle', 'to_world': transform(half @ flip @ lamp),
        'emitter': {'type': 'area', 'radiance': {'type': 'rgb', 'value': job['radiance']}}},
    'body': {'type': 'ply', 'filename': job['out'] + '.ply', 'face_normals': True, 'bsdf': {'type': 'null'},
        'interior': {'type': 'homogeneous', 'albedo': {'type': 'rgb', 'value': (job['sigma_s'] / total).tolist()},
                     'sigma_t': {'type': 'rgb', 'value': (total / most).tolist()}, 'scale': most,
                     'phase': {'type': 'isotropic'}}}})
np.array(mi.render(scene, spp=1, seed=999))  # compiles
start = clock()
picture = np.array(mi.render(scene, spp=job['spp'], seed=job['seed']))
finish(picture, start)
"""
)
CYCLES = (
    COMMON
    + """
import bpy, mathutils
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = 'CYCLES'; c = scene.cycles
c.device = 'CPU'; c.samples = job['spp']; c.seed = job['seed']; c.use_denoising = False; c.use_adaptive_sampling = False
c.pixel_filter_type = 'BOX'; c.filter_width = 1.0; c.sample_clamp_direct = c.sample_clamp_indirect = 0.0
c.max_bounces = c.diffuse_bounces = c.transmission_bounces = 16
scene.render.threads_mode = 'FIXED'; scene.render.threads = job['threads'] or 2
scene.render.resolution_x = scene.render.resolution_y = job['size']; scene.render.resolution_percentage = 100
def nodes_of(owner):
    owner.use_nodes = True
    return owner.node_tree
world = bpy.data.worlds.new('w'); scene.world = world
background = next(n for n in nodes_of(world).nodes if n.type == 'BACKGROUND')
background.inputs['Color'].default_value = (*job['env'], 1); background.inputs['Strength'].default_value = 1.0
def add_mesh(name, vertices, faces, material, at=np.eye(4)):
    data = bpy.data.meshes.new(name); data.from_pydata(vertices.tolist(), [], faces.tolist())
    data.materials.append(material); item = bpy.data.objects.new(name, data)
    item.matrix_world = mathutils.Matrix(np.asarray(at).T.tolist()); scene.collection.objects.link(item)
# Cycles maps (color, radius) to (alpha, sigma_t) [its subsurface_random_walk_remap]: the inverse of that.
total = np.add(job['sigma_s'], job['sigma_a']); alpha = job['sigma_s'] / total
colors = np.linspace(0, 1, 200001)
alphas = 1 - np.exp(colors * (-5.09406 + colors * (2.61188 - colors * 4.31805)))
color = np.interp(alpha, alphas, colors); stretch = 1.9 - color + 3.5 * (color - 0.8) ** 2
ice = bpy.data.materials.new('ice')
surface = next(n for n in nodes_of(ice).nodes if n.type == 'BSDF_PRINCIPLED')
surface.subsurface_method = 'RANDOM_WALK'
for name, value in (('Base Color', (*color, 1)), ('Subsurface Weight', 1.0), ('Subsurface Scale', 1.0),
                    ('Subsurface Radius', tuple(1 / (total * stretch))), ('Specular IOR Level', 0.0)):
    surface.inputs[name].default_value = value
add_mesh('body', V, F, ice)
glow = bpy.data.materials.new('glow'); tree = nodes_of(glow); tree.nodes.clear()
emission = tree.nodes.new('ShaderNodeEmission'); emission.inputs['Strength'].default_value = job['radiance']
output = tree.nodes.new('ShaderNodeOutputMaterial'); tree.links.new(emission.outputs[0], output.inputs[0])
w = job['width'] / 2
add_mesh('lamp', np.array([[-w, -w, 0], [-w, w, 0], [w, w, 0], [w, -w, 0]]), np.array([[0, 1, 2, 3]]), glow, lamp)
camera = bpy.data.cameras.new('c'); camera.sensor_fit = 'HORIZONTAL'; camera.angle = job['fov']
item = bpy.data.objects.new('c', camera); item.matrix_world = mathutils.Matrix(matrix.T.tolist())
scene.collection.objects.link(item); scene.camera = item
scene.render.image_settings.file_format = 'OPEN_EXR'; scene.render.image_settings.color_depth = '32'
scene.render.filepath = job['out'] + '.exr'
start = clock()
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(job['out'] + '.exr')
picture = np.array(image.pixels[:], np.float32).reshape(job['size'], job['size'], -1)[::-1]
finish(picture, start)
"""
)
RENDERERS = {"frazil": FRAZIL, "frazil, spacing x 2": FRAZIL, "mitsuba volpath": MITSUBA, "cycles random walk": CYCLES}


def look_at(eye, target) -> np.ndarray:
    """Local-to-world for row vectors of something that looks along -z, +y up."""
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:, :3] = right, np.cross(back, right), back, eye
    return matrix


def save_body(folder: Path, positions: np.ndarray, triangles: np.ndarray) -> str:
    path = folder / "body.npz"
    np.savez(path, V=positions.astype(np.float32), F=triangles.astype(np.int32))
    return str(path)


def spires(folder: Path, triangles: int) -> dict[str, dict]:
    """The cluster's scenes by name of the medium."""
    import frazil as fz

    part = fz.formations.spire_cluster(seed=1, triangles=triangles).part("Ice")
    scene = {
        "mesh": save_body(folder, part.positions, part.triangles),
        "camera": look_at((1.1, 1.6, 7.4), (0.0, 1.75, 0.0)).tolist(),
        "fov": float(np.radians(36.0)),
        "lamp": look_at((-5.0, 5.5, -2.0), (0.0, 1.5, 0.0)).tolist(),
        "width": 2.5,
        "env": [0.3] * 3,
        "radiance": 12.0,
    }
    return {name: scene | {"sigma_s": scatter, "sigma_a": absorb} for name, (scatter, absorb) in MEDIA.items()}


def reference_medium(folder: Path, reference: Path, mesh: Path) -> dict[str, dict]:
    """The scene of a path-traced reference (bench/truth.py), by its name."""
    import trimesh

    params = json.loads(str(np.load(reference)["params"]))
    shape = trimesh.load(mesh, process=False)
    centre, target, half, radiance = params["light"]
    scene = {
        "mesh": save_body(folder, np.asarray(shape.vertices), np.asarray(shape.faces)),
        "camera": look_at(*params["camera"]).tolist(),
        "fov": float(np.radians(params["fov"])),
        "lamp": look_at(centre, target).tolist(),
        "width": 2.0 * half,
        "env": params["env"],
        "radiance": radiance,
        "sigma_s": params["sigma_s_prime"],
        "sigma_a": params["sigma_a"],
    }
    return {reference.stem: scene}


def kept_file(cache: Path | None, name: str, job: dict) -> Path | None:
    """Where a peer's render is kept, by what it is made of; None where it is not."""
    if cache is None or name.startswith("frazil"):
        return None
    cache.mkdir(parents=True, exist_ok=True)
    settings = json.dumps({key: value for key, value in job.items() if key != "mesh"}, sort_keys=True)
    key = hashlib.sha256(RENDERERS[name].encode() + settings.encode() + Path(job["mesh"]).read_bytes()).hexdigest()
    return cache / f"{key}.npz"


def run(python: str, name: str, job: dict, folder: Path, options: argparse.Namespace) -> dict | str:
    """One render in its own process; its arrays, or why there are none."""
    out = folder / "out.npz"
    out.unlink(missing_ok=True)
    kept = kept_file(options.cache, name, job)
    if kept and kept.exists():
        shutil.copy(kept, out)
        return arrays(out)
    command = [python, "-c", RENDERERS[name], json.dumps(job | {"out": str(out)})]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=options.limit)
    except subprocess.TimeoutExpired:
        return f"more than {options.limit:.0f} s"
    if not out.exists():
        return (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1][:120]
    if kept:
        shutil.copy(out, kept)
    return arrays(out)


def arrays(out: Path) -> dict:
    result = dict(np.load(out))
    result["picture"] = result["picture"][..., :3]
    return result


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def race(options: argparse.Namespace, peers_python: str, folder: Path) -> list[dict]:
    """Rows by medium, size and renderer."""
    media = reference_medium(folder, *options.reference) if options.reference else spires(folder, options.triangles)
    job = {"threads": options.threads, "variant": options.variant}
    samples = {
        "frazil": options.samples,
        "frazil, spacing x 2": options.samples,
        "mitsuba volpath": options.spp,
        "cycles random walk": options.cycles_spp,
    }
    rows = []
    for medium, scene in media.items():
        for size in options.sizes:
            pairs = {}
            for name in options.only:
                python = sys.executable if name.startswith("frazil") else peers_python
                both = []
                for seed in (1, 2):
                    wanted = scene | {"size": size, "seed": seed, "spp": samples[name]}
                    wanted["spacing_scale"] = 2.0 if name.endswith("x 2") else 1.0
                    both.append(run(python, name, job | wanted, folder, options))
                    if isinstance(both[-1], str):
                        break
                failed = [b for b in both if isinstance(b, str)]
                if failed:
                    rows.append({"medium": medium, "size": size, "renderer": name, "error": failed[0]})
                    print(name, failed[0], flush=True)
                else:
                    pairs[name] = both
                    print(f"{medium} {size} {name}: {both[0]['cpu']:.1f} s", flush=True)
            rows += compare(medium, size, pairs, samples, scene)
            if options.pictures:
                save_pictures(options.pictures, medium, size, pairs)
    return rows


def compare(medium: str, size: int, pairs: dict, samples: dict, scene: dict) -> list[dict]:
    """Noise and bias of every renderer, against the mean of Mitsuba's two pictures."""
    if "mitsuba volpath" not in pairs:
        return []
    means = {name: 0.5 * (a["picture"] + b["picture"]) for name, (a, b) in pairs.items()}
    truth = means["mitsuba volpath"]
    # Pixels that the body fills: what is seen beside it is the sky, or nothing where a renderer has no background.
    inside = body_pixels(truth, scene)
    scale = rms(truth[inside])
    noises = {name: rms((a["picture"] - b["picture"])[inside]) / np.sqrt(2) / scale for name, (a, b) in pairs.items()}
    truth_noise = noises["mitsuba volpath"] / np.sqrt(2)
    rows = []
    for name, (a, b) in pairs.items():
        seconds, wall = float(a["cpu"] + b["cpu"]) / 2, float(a["wall"] + b["wall"]) / 2
        row = {"medium": medium, "size": size, "renderer": name, "samples": samples[name], "seconds": seconds}
        row |= {"wall": wall, "noise": noises[name], "peak": int(max(a["peak"], b["peak"]))}
        if name != "mitsuba volpath":
            error = rms((means[name] - truth)[inside]) / scale
            row["bias"] = float(np.sqrt(max(0.0, error**2 - truth_noise**2 - noises[name] ** 2 / 2)))
            row["mean ratio"] = float(means[name][inside].mean() / truth[inside].mean())
        else:
            row |= {"bias": 0.0, "mean ratio": 1.0, "truth noise": truth_noise}
        for wanted in (0.02, 0.01):
            # Frazil's own time is fixed cost for the most part: it is not scaled where its noise is below.
            factor = (noises[name] / wanted) ** 2
            row[f"to {wanted:.0%}"] = seconds * (max(1.0, factor) if name.startswith("frazil") else factor)
        rows.append(row)
    return rows


def body_pixels(truth: np.ndarray, scene: dict) -> np.ndarray:
    """Neither sky nor lamp, whose radiance is exact in every sample, nor beside them."""
    is_sky = np.all(np.abs(truth - scene["env"]) < 1e-4, axis=-1)
    is_sky |= np.any(np.abs(truth - scene["radiance"]) < 1e-3, axis=-1)
    grown = is_sky.copy()
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            grown |= np.roll(is_sky, (dy, dx), (0, 1))
    return ~grown


def save_pictures(folder: Path, medium: str, size: int, pairs: dict) -> None:
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    for name, (a, b) in pairs.items():
        picture = np.clip(0.5 * (a["picture"] + b["picture"]), 0, 1) ** (1 / 2.2)
        Image.fromarray(np.uint8(picture * 255)).save(folder / f"{medium}_{size}_{name.replace(' ', '_')}.png")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--sizes", type=int, nargs="+", default=[96, 192])
    parser.add_argument("--spp", type=int, default=64, help="of Mitsuba, per run")
    parser.add_argument("--cycles-spp", type=int, default=16, help="of Cycles, per run")
    parser.add_argument("--samples", type=int, default=8, help="of Frazil")
    parser.add_argument("--triangles", type=int, default=60_000, help="of the cluster of spires")
    parser.add_argument(
        "--reference", type=Path, nargs=2, metavar=("NPZ", "MESH"), help="instead of the spires: see bench/truth.py"
    )
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--variant", default="scalar_rgb", help="of Mitsuba: llvm_ad_rgb where its LLVM works")
    parser.add_argument("--limit", type=float, default=900.0, help="seconds a render may take")
    parser.add_argument("--only", nargs="+", choices=list(RENDERERS), default=list(RENDERERS))
    parser.add_argument("--cache", type=Path, help="folder that keeps the peers' renders: only Frazil's are made anew")
    parser.add_argument("--pictures", type=Path, help="folder for what was rendered")


def table(rows: list[dict]) -> list[str]:
    lines = [
        "| medium | pixels | renderer | samples | processor s | noise | bias | mean / truth | s to 2 % noise "
        "| s to 1 % noise | peak MB |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        head = f"| {row['medium']} | {row['size']}² | {row['renderer']} "
        if "error" in row:
            lines.append(f"{head}| - | {row['error']} | | | | | | |")
            continue
        lines.append(
            f"{head}| {row['samples']} | {row['seconds']:.1f} | {row['noise']:.2%} | {row['bias']:.1%} "
            f"| {row['mean ratio']:.3f} | {row['to 2%']:.1f} | {row['to 1%']:.1f} | {row['peak'] / 1e6:.0f} |"
        )
    return lines


def main() -> None:
    sys.path.insert(0, str(Path(__file__).parent))
    from points import peers_python

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_options(parser)
    parser.add_argument("--peers-python", help="a Python with mitsuba and bpy; otherwise one is made in build/peers")
    parser.add_argument("-o", "--output", type=Path, default=Path("bench/results/race.json"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        rows = race(options, options.peers_python or peers_python(Path("build/peers")), Path(temporary))
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(rows, indent=1))
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
