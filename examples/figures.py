"""The figures of the talk [Xie2014], made anew: pictures, and the numbers that belong beside them.

    python examples/figures.py [-o docs/images] [--only 1 3 4 5 6 7] [--resolution 320x180] [--samples 12]

Every figure is a function; each writes figure_N.png and prints what was measured, all of it also to figures.json. The
ice comes from frazil.formations, the teapot from teapot.py. Needs matplotlib. docs/figures.md sets the figures against
the talk's claims.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont
from pxr import Sdf, Usd, UsdShade

import frazil as fz
import teapot
from frazil.denoise import denoise_film
from frazil.image import display_rgb

_LABEL_HEIGHT = 20


def shown(linear: np.ndarray) -> Image.Image:
    """Linear RGB as a picture on a display."""
    pixels, _ = display_rgb(np.ascontiguousarray(linear[..., :3], np.float32))
    return Image.fromarray(np.uint8(np.clip(pixels, 0, 1) * 255 + 0.5))


def colored(values: np.ndarray, low: float, high: float, name: str = "viridis") -> Image.Image:
    """One number a pixel in false colours."""
    import matplotlib

    share = np.clip((np.nan_to_num(values) - low) / (high - low), 0, 1)
    return Image.fromarray(np.uint8(matplotlib.colormaps[name](share)[..., :3] * 255))


def write_sheet(path: Path, panels: list[tuple[str, Image.Image]], columns: int) -> None:
    """Panels of one size in rows, each under its label; a PNG of 256 colours."""
    width, height = panels[0][1].size
    rows = -(-len(panels) // columns)
    gap = 4
    sheet = Image.new("RGB", (columns * (width + gap) - gap, rows * (height + _LABEL_HEIGHT + gap) - gap), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(13)
    for i, (label, picture) in enumerate(panels):
        x, y = i % columns * (width + gap), i // columns * (height + _LABEL_HEIGHT + gap)
        draw.text((x + 3, y + 2), label, fill="black", font=font)
        sheet.paste(picture, (x, y + _LABEL_HEIGHT))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


class Studio:
    """Where scenes are made and rendered: at one resolution, kept for the figures that share them."""

    def __init__(self, folder: Path, resolution: tuple[int, int], samples: int, threads: int):
        self.folder, self.resolution, self.samples, self.threads = folder, resolution, samples, threads
        folder.mkdir(parents=True, exist_ok=True)

    def scene(self, formation: fz.formations.Formation, **ice) -> fz.Scene:
        """The formation as a stage that is read back, with inputs of its ice changed."""
        path = self.folder / f"{formation.name}.usdc"
        fz.formations.write_formation(formation, path)
        stage = Usd.Stage.Open(str(path))
        for prim in stage.Traverse():
            shader = UsdShade.Shader(prim)
            if not shader or shader.GetShaderId() != "frazil:ice":
                continue
            for name, value in ice.items():
                types = Sdf.ValueTypeNames
                kind = types.Color3f if isinstance(value, tuple) else types.Float
                if isinstance(value, list):
                    kind = types.Color3fArray if name == "ramp_colors" else types.FloatArray
                shader.CreateInput(name, kind).Set(value)
        stage.Save()
        return fz.load_usd(path)

    def render(self, scene: fz.Scene, **options) -> fz.Film:
        chosen = {"resolution": self.resolution, "samples": self.samples, "threads": self.threads}
        return fz.render(scene, **(chosen | options))


def painted(linear: np.ndarray) -> np.ndarray:
    """A picture as a painter might lay it in: small dabs, few colours, linear again."""
    dabs = shown(linear).filter(ImageFilter.ModeFilter(7)).filter(ImageFilter.MedianFilter(3))
    values = np.asarray(dabs.quantize(48).convert("RGB"), np.float32) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(np.float32)


def figure_1(studio: Studio, out: Path) -> dict:
    """Figures 1 and 8: a render brought to a painting by its lights alone."""
    film = studio.render(studio.scene(fz.formations.spire_cluster(seed=1, triangles=150_000)), denoise=True)
    dusk = {"lights": {"sky": {"color": [0.35, 0.45, 0.72]}, "sun": {"color": [0.8, 0.5, 0.26]}}}
    painting = painted(fz.grade(film, dusk)["beauty"][..., :3])
    start = time.process_time()
    # Glints and sunlit snow clip in a painting: least squares would dim the sun for their sake.
    mask = (film["beauty"][..., :3].max(axis=-1) < 1.0).astype(np.float32)
    found = fz.match(film, painting, what=("lights",), mask=mask)
    seconds = time.process_time() - start
    matched = fz.grade(film, found.recipe)["beauty"]
    write_sheet(
        out / "figure_1.png",
        [
            ("painting to match", shown(painting)),
            ("render as lit", shown(film["beauty"])),
            ("matched: lights only, no new render", shown(matched)),
        ],
        3,
    )
    recovered = {name: entry.get("color", [1, 1, 1]) for name, entry in found.recipe["lights"].items()}
    scale = {name: found.recipe["lights"][name].get("intensity", 1.0) for name in recovered}
    lights = {name: [round(scale[name] * c, 3) for c in color] for name, color in recovered.items()}
    return {
        "pixels that count": float(mask.mean()),
        "FLIP before": found.flip_before,
        "FLIP after": found.flip_after,
        "match, processor seconds": seconds,
        "lights of the painting": {name: entry["color"] for name, entry in dusk["lights"].items()},
        "lights found": lights,
        "render": _render_numbers(film),
    }


def figure_3(studio: Studio, out: Path) -> dict:
    """Figure 3: the ramp, colour by distance below the surface, changed after one render."""
    distances = [0.0, 0.04, 0.12, 0.35]
    white = [(1.0, 1.0, 1.0)] * 4
    ramps = {
        "no ramp: the medium's own colours": white,
        "white near, cyan and deep blue far": [(1, 1, 1), (0.75, 1, 1), (0.2, 0.7, 1.0), (0.02, 0.2, 0.9)],
        "green glow inside": [(1, 1, 1), (0.7, 1.0, 0.8), (0.3, 1.0, 0.5), (0.05, 0.6, 0.3)],
        "rose near, violet far": [(1.0, 0.8, 0.75), (1.0, 0.55, 0.7), (0.6, 0.3, 1.0), (0.25, 0.1, 0.8)],
    }
    formation = fz.formations.ice_tips(seed=0, triangles=60_000)
    # Denser than glacier ice, so that light comes from as near as the tips are thick.
    dense = {"sigma_s_prime": (45.0, 45.0, 45.0), "refraction": 0.0, "spacing": 0.008}
    look = dense | {"ramp_distances": distances, "ramp_colors": white}
    film = studio.render(studio.scene(formation, **look), aovs=["translucency_ramp"], bake_bounces=0)
    # The same ramp by a new render, to see that the grade is that.
    colors = ramps["white near, cyan and deep blue far"]
    scene = studio.scene(formation, **(look | {"ramp_colors": colors}))
    again = studio.render(scene, aovs=["translucency_ramp"], bake_bounces=0)["translucency"]
    regraded = fz.grade(film, _ramp_recipe(colors), keep_layers=True)["translucency"]
    error = np.sqrt(np.mean((regraded - again) ** 2)) / np.sqrt(np.mean(again**2))
    denoise_film(film)
    panels, means, seconds = [], {}, 0.0
    for name, colors in ramps.items():
        start = time.process_time()
        graded = fz.grade(film, _ramp_recipe(colors))["beauty"]
        seconds = max(seconds, time.process_time() - start)
        panels.append((name, shown(graded)))
        ice = film["translucency"][..., 1] > 0.02
        means[name] = [round(float(v), 3) for v in graded[ice][:, :3].mean(axis=0)]
    write_sheet(out / "figure_3.png", panels, 2)
    return {
        "grade, processor seconds": seconds,
        "mean colour of the ice": means,
        "grade against new render, relative RMS": float(error),
        "render": _render_numbers(film),
    }


def _ramp_recipe(colors: list[tuple[float, ...]]) -> dict:
    return {"ramp": {"colors": [list(map(float, c)) for c in colors]}}


def figure_4(studio: Studio, out: Path) -> dict:
    """Figure 4: tips with and without area compensation, and translucency from a tenth of the points."""
    formation = fz.formations.ice_tips(seed=0, triangles=60_000)
    scene = studio.scene(formation, refraction=0.0)
    film = studio.render(scene, aovs=["compensation_off", "compensation_factor"], denoise=True)
    factor = film["compensation_factor"][..., 1]
    off, on = film["compensation_off"], film["translucency"]
    ice = film["translucency"][..., 1] > 1e-3
    tips, bodies = ice & (factor > 0.4), ice & (np.abs(factor) < 0.15)
    write_sheet(
        out / "figure_4.png",
        [
            ("translucency, no compensation", shown(off)),
            ("with compensation", shown(on)),
            ("what a point sum misses: 1 - W/Rd_total", colored(np.where(ice, factor, -9.0), -1.0, 1.0, "inferno")),
            ("picture", shown(film["beauty"])),
        ],
        2,
    )

    def luminance(layer: np.ndarray, where: np.ndarray) -> float:
        return float((layer[where] @ np.array([0.2126, 0.7152, 0.0722])).mean())

    numbers = {
        f"tips / bodies, {name}": luminance(layer, tips) / luminance(layer, bodies)
        for name, layer in (("without", off), ("with", on))
    }
    numbers["pixels of tips"] = int(tips.sum())
    numbers["render"] = _render_numbers(film)
    return numbers | {"a tenth of the points": _sparse(studio, scene)}


def _sparse(studio: Studio, scene: fz.Scene) -> dict:
    """Error of the translucency from a tenth of the points, with both estimators, against that of all."""
    few = {"samples": 4, "resolution": (240, 135), "bake_samples": 256, "bake_bounces": 0}
    dense = studio.render(scene, spacing=0.0045, **few)
    result = {"points": dense.stats["points"]}
    for estimator in ("noise_free", "sum"):
        film = studio.render(scene, spacing=0.0045 * np.sqrt(10), estimator=estimator, **few)
        error = film["translucency"] - dense["translucency"]
        scale = np.sqrt(np.mean(dense["translucency"] ** 2))
        result[f"{estimator}, relative RMS"] = float(np.sqrt(np.mean(error**2)) / scale)
        result["points of the tenth"] = film.stats["points"]
    return result


def figure_5(studio: Studio, out: Path) -> dict:
    """Figure 5: the teapot, tessellated against Poisson points; and what the same translucency costs with either."""
    measured = teapot.draw(out / "points_teapot.png")
    result = {
        name: {
            "points": s.count,
            "gap / nearest pair": s.gap / s.min_distance,
            "distance spread": s.distance_spread,
            "area spread": s.area_spread,
        }
        for name, s in measured.items()
    }
    # Translucency at 2,000 places by the number of points, against a dense sum: RMS and worst place.
    mesh = teapot.teapot(6)
    profile = fz.Dipole(fz.Medium(sigma_s_prime=(8.0, 8.0, 8.0), sigma_a=(0.05, 0.05, 0.05)))
    places = fz.poisson_points(mesh, count=2000, seed=9)

    def translucency(points: fz.PointSet) -> np.ndarray:
        light = np.maximum(points.normals @ np.float32([0.4, 0.8, 0.45]), 0)[:, None].repeat(3, axis=1)
        tree = fz.PointTree(points, np.ascontiguousarray(light), profile)
        return tree.gather(places.positions, tolerance=0.003).exitance[:, 0, 0]

    dense = translucency(fz.poisson_points(mesh, 0.01))
    for name, make in (("tessellated", fz.tessellated_points), ("Poisson", fz.poisson_points)):
        rows = []
        for size in (0.5, 0.3, 0.2, 0.12, 0.08):
            points = make(mesh, size if name == "tessellated" else 0.4 * size)
            error = np.abs(translucency(points) - dense) / np.sqrt(np.mean(dense**2))
            statistics = fz.point_statistics(points, mesh)
            rows.append(
                {
                    "points": len(points),
                    "gap": statistics.gap,
                    "RMS": float(np.sqrt(np.mean(error**2))),
                    "worst": float(error.max()),
                }
            )
        result[name]["by points"] = rows
    # What a picture's translucency costs at one largest gap, 0.048: all but the picture's own rays.
    places = fz.poisson_points(mesh, count=20_000, seed=9)
    result["processor seconds for the same gap"] = {
        "tessellated": _seconds(mesh, lambda: fz.tessellated_points(mesh, 0.08), profile, places),
        "Poisson": _seconds(mesh, lambda: fz.poisson_points(mesh, 0.4 * 0.12), profile, places),
    }
    # Points for the same largest gap, which is what spacing is chosen by: N falls as the gap squared.
    regular, poisson = (result[name]["by points"][-1] for name in ("tessellated", "Poisson"))
    result["points for the same gap, tessellated / Poisson"] = (
        regular["points"] * regular["gap"] ** 2 / (poisson["points"] * poisson["gap"] ** 2)
    )
    return result


def _seconds(mesh: fz.Mesh, make: Callable[[], fz.PointSet], profile: fz.Dipole, places: fz.PointSet) -> dict:
    """Processor seconds of each stage: points, light of a sky and a sun, tree and gather at `places`."""
    rays = fz.RayScene([mesh])
    sun = fz.Light(fz.DistantLight(2.0), radiance=(3.0, 3.0, 3.0), normalize=True)  # irradiance 3, the sky's is pi
    lights = [fz.Light(fz.DomeLight()), sun]
    clock = [time.process_time()]
    points = make()
    clock.append(time.process_time())
    irradiance = fz.bake_irradiance(points, rays, lights)
    clock.append(time.process_time())
    tree = fz.PointTree(points, irradiance, profile)
    clock.append(time.process_time())
    tree.gather(places.positions)
    clock.append(time.process_time())
    stages = dict(zip(("points", "light", "tree", "gather"), np.diff(clock).round(3).tolist(), strict=True))
    return stages | {"all": round(clock[-1] - clock[0], 3)}


def figure_6(studio: Studio, out: Path) -> dict:
    """Figure 6: the points of a massive form from near."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    part = fz.formations.spire_cluster(seed=1, triangles=300_000).part("Ice")
    mesh = fz.Mesh(part.positions, part.triangles)
    start = time.process_time()
    points = fz.poisson_points(mesh, float(np.sqrt(0.7 * mesh.area / 600_000)))
    seconds = time.process_time() - start
    view = teapot.View(mesh, size=900, turn=0.0, tilt=0.15)
    seen, is_visible = view.visible(points)
    seen, normals = seen[is_visible], (points.normals @ view.axes.T.astype(np.float32))[is_visible]
    shade = np.clip(normals @ np.array([-0.5, 0.65, 0.57]), 0, 1) * 0.75 + 0.25
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), facecolor="white")
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    # Around a place on the tallest spire, below its tip.
    tip = seen[seen[:, 1].argmax(), :2]
    target = tip - [0.0, 0.22 * (high - low)[1]]
    for axis, zoom in zip(axes, (1, 8, 60), strict=True):
        half = 0.52 * (high - low).max() / zoom
        center = 0.5 * (low + high) if zoom == 1 else target
        inside = (np.abs(seen[:, :2] - center) < half).all(axis=1)
        order = np.argsort(seen[inside, 2])
        size = 0.3 if zoom == 1 else 0.6 * (0.5 * points.spacing / (2 * half) * 290) ** 2
        axis.scatter(*seen[inside][order, :2].T, c=shade[inside][order], s=size, cmap="bone", vmin=0, vmax=1, lw=0)
        axis.set(xlim=center[0] + np.array([-half, half]), ylim=center[1] + np.array([-half, half]))
        axis.set(aspect="equal", xticks=[], yticks=[], facecolor="#10202c")
        axis.set_title(f"{2 * half:.2f} m wide" + (f", {len(points):,} points" if zoom == 1 else ""), fontsize=10)
    figure.tight_layout()
    figure.savefig(out / "figure_6.png", dpi=80)
    plt.close(figure)
    teapot.quantise(out / "figure_6.png")
    measured = fz.point_statistics(points, mesh)
    return {
        "points": len(points),
        "triangles": len(mesh.triangles),
        "processor seconds": seconds,
        "nearest pair / spacing": measured.min_distance / points.spacing,
        "gap / spacing": measured.gap / points.spacing,
        "area spread": measured.area_spread,
    }


def figure_7(studio: Studio, out: Path) -> dict:
    """Figure 7: what a picture is made of."""
    scene = studio.scene(fz.formations.spire_cluster(seed=1, triangles=150_000), volume=1.0)
    width, height = studio.resolution
    size = (width * 3 // 4, height * 3 // 4)
    film = studio.render(scene, resolution=size, aovs=["compensation_factor"], denoise=True)
    additive = ("translucency", "refraction", "volume", "specular", "diffuse", "background", "emission")
    total = sum(film[name].astype(np.float64) for name in additive)
    panels = [("beauty = sum of:", shown(film["beauty"]))]
    panels += [(name, shown(film[name])) for name in additive if name != "emission"]
    panels += [(f"translucency by {group}", shown(film[f"translucency_{group}"])) for group in ("sky", "sun")]
    depth = film["Z"][..., 0]
    panels.append(("Z, 5 to 12 m", colored(-np.where(np.isfinite(depth), depth, 1e9), -12, -5, "bone")))
    factor = np.where(film["translucency"][..., 1] > 1e-3, film["compensation_factor"][..., 1], -9.0)
    panels.append(("compensation_factor, -1 to 1", colored(factor, -1.0, 1.0, "inferno")))
    write_sheet(out / "figure_7.png", panels, 4)
    return {
        "largest difference of the sum": float(np.abs(total - film["beauty"][..., :3]).max()),
        "layers": len(list(film)),
        "render": _render_numbers(film),
    }


def _render_numbers(film: fz.Film) -> dict:
    return {
        "pixels": f"{film.width}x{film.height}",
        "points": film.stats["points"],
        "gathers": film.stats.get("gathers"),
        "seconds": {name: round(value, 2) for name, value in film.stats["seconds"].items()},
    }


FIGURES = {1: figure_1, 3: figure_3, 4: figure_4, 5: figure_5, 6: figure_6, 7: figure_7}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images"), help="folder of the pictures")
    parser.add_argument("--work", type=Path, default=Path("out/figures"), help="folder of stages and figures.json")
    parser.add_argument("--only", type=int, nargs="+", choices=FIGURES, default=list(FIGURES))
    parser.add_argument("--resolution", default="320x180")
    parser.add_argument("--samples", type=int, default=12)
    parser.add_argument("--threads", type=int, default=0)
    options = parser.parse_args()
    resolution = tuple(int(n) for n in options.resolution.split("x"))
    studio = Studio(options.work, resolution, options.samples, options.threads)
    record = options.work / "figures.json"
    numbers = json.loads(record.read_text()) if record.exists() else {}
    for number in options.only:
        start = time.perf_counter(), time.process_time()
        measured = FIGURES[number](studio, options.output)
        spent = time.perf_counter() - start[0], time.process_time() - start[1]
        measured |= {"seconds": round(spent[0], 1), "processor seconds of all": round(spent[1], 1)}
        numbers[str(number)] = measured
        record.write_text(json.dumps(numbers, indent=1))
        print(f"figure {number}: {json.dumps(measured, indent=1)}", flush=True)


if __name__ == "__main__":
    main()
