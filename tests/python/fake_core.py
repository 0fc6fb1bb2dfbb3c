"""A core and a USD reader that answer at once, so that film, files and command line are tested apart from rendering."""

from types import SimpleNamespace

import numpy as np

from frazil.usd.settings import RenderSettings

AOVS = [
    ("beauty", "RGBA", False, True),
    ("translucency", "RGB", True, True),
    ("specular", "RGB", True, True),
    ("Z", "Z", False, False),
    ("N", "XYZ", False, True),
    ("P", "XYZ", False, False),
    ("object_id", "I", False, False),
    ("coverage", "RGB", False, True),
]


CAMERA_TO_WORLD = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [1, 2, 3, 1]], float)  # row vectors


def aov_table():
    fixed = {"meaning": "made up", "filter": "average", "is_default": True}
    return [fixed | dict(zip(("name", "channels", "is_additive", "is_half"), row, strict=True)) for row in AOVS]


def layers(width=16, height=9, seed=1):
    """Every layer of the table, random; the additive ones sum to the beauty."""
    random = np.random.default_rng(seed)
    made = {name: random.random((height, width, len(channels)), np.float32) for name, channels, *_ in AOVS}
    made["beauty"][:, :, :3] = made["translucency"] + made["specular"]
    made["object_id"][:] = random.integers(0, 70_000, made["object_id"].shape)
    return made


class Core:
    """Stands for the extension module's `render`; remembers what it was asked."""

    def __init__(self, steps=4, on_step=None):
        self.options = None
        self.frames = []
        self.steps = steps
        self.on_step = on_step

    def render(self, scene, options, *, progress, **job):
        names = [name for name in dir(options) if not name.startswith("_")]
        self.options = {name: getattr(options, name) for name in names}
        self.options["spacing"] = round(options.spacing, 6)  # a float32 in the core
        self.job = job
        self.frames.append(scene.frame)
        for stage in ("points", "bake", "tree", "render"):
            for step in range(self.steps):
                progress(stage, (step + 1) / self.steps)
                if self.on_step:
                    self.on_step(stage, step)
        stats = {
            "points": 10,
            "nodes": 3,
            "dropped_samples": 2,
            "warnings": [],
            "seconds": {"points": 0.1, "render": 0.2},
        }
        return SimpleNamespace(
            layers=layers(options.width, options.height),
            stats=stats,
            light_groups=["key", ""],
            ramp_knots=[],
            compensations=[],
            overlays=[],
        )


def scene(frame=None, camera="/World/Camera", resolution=None, file="scene.usda"):
    """What the renderer and the command line ask of a scene."""
    return SimpleNamespace(
        file=str(file),
        frame=frame,
        camera=SimpleNamespace(path=camera, matrix=CAMERA_TO_WORLD),
        objects=[SimpleNamespace(path="/World/Ice"), SimpleNamespace(path="/World/Rock")],
        render_settings=RenderSettings("/Settings", resolution),
    )


def load_usd(path, frame=None, camera=None, rest_frame=None, materials=None, look=None):
    return scene(frame, camera or "/World/Camera", file=path)


def install(monkeypatch, core):
    """Put the fakes where the package looks for the real ones."""
    import frazil._frazil
    import frazil.usd

    monkeypatch.setattr(frazil._frazil, "render", core.render, raising=False)
    monkeypatch.setattr(frazil._frazil, "aov_table", aov_table, raising=False)
    monkeypatch.setattr(frazil.usd, "load_usd", load_usd, raising=False)
