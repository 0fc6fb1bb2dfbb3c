"""Opening a stage and filling a Scene from it: units, up axis and time are settled here, once."""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Iterable
from pathlib import Path

from pxr import Tf, Usd, UsdUtils

from .._frazil import Mesh, Scene
from ..warning import FrazilWarning
from .camera import choose_camera
from .context import ReadContext
from .instancing import StageWalker
from .lights import add_grey_dome
from .mtlx import compose_references, override_materials
from .settings import RenderSettings, read_render_settings


class UsdScene(Scene):
    """A Scene that was read from a stage, with what the stage says beside it.

    Attributes
    ----------
    file : str
        The root layer.
    frame : float or None
        The time code that was read; None for default values.
    render_settings : RenderSettings or None
        Resolution, camera and products, where the stage has them.
    mattes : dict of str to list of int
        Objects of the collections ``matte:NAME``, by NAME.
    warnings : list of str
        Everything that was left out or replaced, each beginning with a prim's path.
    """

    file: str
    frame: float | None
    render_settings: RenderSettings | None
    mattes: dict[str, list[int]]
    warnings: list[str]


def load_usd(
    path: str | os.PathLike,
    frame: float | None = None,
    camera: str | None = None,
    *,
    purposes: Iterable[str] = ("default", "render"),
    subdivision_level: int = 2,
    materials: str | os.PathLike | None = None,
    look: str | None = None,
    rest_frame: float | None = None,
) -> UsdScene:
    """Read a USD stage (.usd, .usda, .usdc, .usdz) as a scene.

    Parameters
    ----------
    path : str or path
        The stage.
    frame : float, optional
        Time code; by default the stage's startTimeCode, or default values where it has no time range.
    camera : str, optional
        Path (or name, where only one has it) of the camera. By default the one that the render settings name, else the
        only one, else one that frames the scene.
    purposes : iterable of str
        Which purposes are rendered, of 'default', 'render', 'proxy' and 'guide'.
    subdivision_level : int
        How often each edge of a Catmull-Clark mesh is halved, >= 0; dense meshes are halved less often.
    materials : str or path, optional
        A MaterialX file whose look takes the place of the stage's own materials on the prims that it names.
    look : str, optional
        The look of that file; by default its first.
    rest_frame : float, optional
        Time code at which meshes that deform are in their rest pose, so that points stay on them in all frames; a
        primvar `rest` or `Pref` of a mesh goes before it.

    Returns
    -------
    UsdScene
        In metres, +y up. Whatever could not be read is named in its `warnings`, and as FrazilWarning.

    Raises
    ------
    OSError
        The file is missing, empty, broken or no USD.
    ValueError
        The camera or the look does not exist, or an option is out of range.

    Examples
    --------
    >>> scene = fz.load_usd("spires.usda", frame=12)  # doctest: +SKIP
    >>> film = fz.render(scene)  # doctest: +SKIP
    """
    context, diagnostics = _open(path, frame, purposes, subdivision_level, rest_frame)
    if materials is not None:
        override_materials(context, os.fspath(materials), look)
    scene = UsdScene()
    walker = StageWalker(context, scene)
    walker.walk()
    scene.mattes = walker.mattes()
    if not scene.objects:
        context.warn(context.file, "has no geometry that can be rendered.")
    if not scene.lights:
        add_grey_dome(context, scene)
    settings = read_render_settings(context)
    scene.camera = choose_camera(context, scene, camera, settings.product.camera if settings else None)
    _pass_on(context, diagnostics)
    scene.file = context.file
    scene.frame = None if context.time.IsDefault() or context.time.IsEarliestTime() else context.time.GetValue()
    scene.render_settings = settings
    scene.reading = (frozenset(purposes), subdivision_level, rest_frame)
    scene.warnings = context.warnings
    return scene


def add_motion(scene: UsdScene, frames: float = 1.0) -> None:
    """Tell a scene how it goes on, so that the layer ``motion`` can be rendered.

    Parameters
    ----------
    scene : UsdScene
        From load_usd.
    frames : float
        How far ahead the place is that motion vectors point to.

    Raises
    ------
    OSError
        The stage is no longer there.

    Examples
    --------
    >>> scene = fz.load_usd("spires.usda", frame=12)  # doctest: +SKIP
    >>> fz.add_motion(scene)  # doctest: +SKIP
    >>> motion = fz.render(scene, aovs=["motion"])["motion"]  # doctest: +SKIP
    """
    if scene.frame is None:  # no time: all stands still
        scene.set_motion(scene)
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrazilWarning)  # said when the scene was read
        context, diagnostics = _open(scene.file, scene.frame + frames, *scene.reading)
        later = Scene()
        StageWalker(context, later).walk()
        prim = context.stage.GetPrimAtPath(scene.camera.path) if scene.camera.path.startswith("/") else None
        later.camera = choose_camera(context, later, scene.camera.path, None) if prim else scene.camera
        diagnostics.TakeUncoalescedDiagnostics()
    scene.set_motion(later)


def read_meshes(
    path: str | os.PathLike, frame: float | None = None, rest_frame: float | None = None
) -> list[tuple[str, Mesh]]:
    """The meshes of a USD stage, instances and all, in world space.

    Parameters
    ----------
    path, frame, rest_frame
        As in load_usd.

    Returns
    -------
    list of (str, Mesh)
        Prim path and mesh, metres, +y up.

    Raises
    ------
    OSError
        The file is missing, empty, broken or no USD.
    """
    context, diagnostics = _open(path, frame, ("default", "render"), 2, rest_frame)
    scene = Scene()
    StageWalker(context, scene).walk()
    _pass_on(context, diagnostics)
    return [(item.path, scene.mesh(item.mesh).transformed(item.matrix)) for item in scene.objects]


def _open(path, frame: float | None, purposes: Iterable[str], subdivision_level: int, rest_frame: float | None = None):
    """The stage at its time, and the delegate that keeps USD's own messages off the terminal."""
    name = os.fspath(path)
    if frame is not None and not math.isfinite(frame):
        raise ValueError(f"{name}: frame must be a finite number, got {frame}.")
    if rest_frame is not None and not math.isfinite(rest_frame):
        raise ValueError(f"{name}: rest_frame must be a finite number, got {rest_frame}.")
    if not 0 <= subdivision_level <= 8:
        raise ValueError(f"{name}: subdivision_level must be in 0..8, got {subdivision_level}.")
    wanted = frozenset(purposes)
    unknown = wanted - {"default", "render", "proxy", "guide"}
    if unknown:
        raise ValueError(f"{name}: purposes must be of default, render, proxy, guide, got '{sorted(unknown)[0]}'.")
    if not Path(name).exists():
        raise FileNotFoundError(f"{name}: no such file.")
    if not Path(name).is_file():
        raise OSError(f"{name}: is not a file.")
    if Path(name).stat().st_size == 0:
        raise OSError(f"{name}: the file is empty.")
    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        stage = Usd.Stage.Open(name)
    except Tf.ErrorException as error:
        raise OSError(f"{name}: is not a readable USD file: {_first_line(error)}") from error
    if stage is None:
        raise OSError(f"{name}: is not a readable USD file.")
    if frame is not None:
        time = Usd.TimeCode(frame)
    elif stage.HasAuthoredTimeCodeRange():
        time = Usd.TimeCode(stage.GetStartTimeCode())
    else:
        time = Usd.TimeCode.EarliestTime()
    rest_time = None if rest_frame is None else Usd.TimeCode(rest_frame)
    context = ReadContext(stage, name, time, wanted, subdivision_level, rest_time)
    compose_references(context)
    return context, diagnostics


def _first_line(error: Tf.ErrorException) -> str:
    """What USD itself said, without where in its source."""
    said = [getattr(e, "commentary", str(e)).strip() for e in error.args]
    lines = [line.strip() for text in said for line in text.splitlines() if line.strip()]
    return lines[0] if lines else "it cannot be opened"


def _pass_on(context: ReadContext, diagnostics: UsdUtils.CoalescingDiagnosticDelegate) -> None:
    """USD's own messages (broken references and the like) as warnings, under the prim that they are about."""
    for diagnostic in diagnostics.TakeUncoalescedDiagnostics():
        text = " ".join(diagnostic.commentary.split())
        text = re.sub(r"\s*\((re)?composing stage.*\)$|\s*\(instantiating stage.*\)$", "", text)
        if ".mtlx" in text and "format" in text:
            continue  # compose_references has read it, or has said why not
        about = re.match(r"In <([^>]+)>: (.*)", text)
        if about:
            context.warn(about[1], about[2])
        else:
            context.warn(context.file, f"USD says: {text}")
