"""The camera: the one asked for, the one that the render settings name, the only one, or one that frames the scene."""

from __future__ import annotations

import math

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .._frazil import Camera, Scene
from .context import ReadContext, is_singular

_MOST_FRAMED_VERTICES = 2_000_000  # above, boxes stand for meshes when the scene is framed
_APERTURE_UNIT = 0.1  # apertures and focal lengths are in tenths of a scene unit


def choose_camera(context: ReadContext, scene: Scene, wanted: str | None, from_settings: str | None) -> Camera:
    """Read the camera that the scene is seen by.

    ValueError where the camera that was asked for does not exist.
    """
    stage = context.stage
    cameras = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Camera)]
    if wanted:
        prim = stage.GetPrimAtPath(wanted) if Sdf.Path.IsValidPathString(wanted)[0] else None
        if not (prim and prim.IsA(UsdGeom.Camera)):
            named = [p for p in cameras if p.GetName() == wanted]
            if len(named) != 1:
                known = ", ".join(str(p.GetPath()) for p in cameras) or "none"
                raise ValueError(f"{wanted}: camera must be a camera of {context.file}, which has: {known}.")
            prim = named[0]
        return _read_or_frame(context, scene, prim)
    if from_settings:
        prim = stage.GetPrimAtPath(from_settings)
        if prim and prim.IsA(UsdGeom.Camera):
            return _read_or_frame(context, scene, prim)
        context.warn(from_settings, "is named by the render settings but is no camera.")
    if not cameras:
        context.warn(context.file, "has no camera. The scene's bounds are framed.")
        return frame_scene(scene)
    if len(cameras) > 1:
        others = ", ".join(str(p.GetPath()) for p in cameras[1:])
        context.warn(cameras[0].GetPath(), f"is used, the first of several cameras. Choose one of: {others}.")
    return _read_or_frame(context, scene, cameras[0])


def _read_or_frame(context: ReadContext, scene: Scene, prim: Usd.Prim) -> Camera:
    matrix = context.local_to_world(prim)
    if is_singular(matrix):
        context.warn(prim.GetPath(), "its transform cannot be inverted. The scene's bounds are framed.")
        return frame_scene(scene)
    try:
        return _read_camera(context, prim, matrix)
    except (ValueError, TypeError) as error:
        context.warn(prim.GetPath(), f"cannot be read: {error}. The scene's bounds are framed.")
        return frame_scene(scene)


def _read_camera(context: ReadContext, prim: Usd.Prim, matrix: np.ndarray) -> Camera:
    schema = UsdGeom.Camera(prim)
    scale = np.linalg.norm(matrix[:3, :3], axis=1)
    rigid = matrix.copy()
    rigid[:3, :3] /= scale[:, None]

    values = {}
    for name, attribute, default in (
        ("focal_length", schema.GetFocalLengthAttr(), 50.0),
        ("horizontal_aperture", schema.GetHorizontalApertureAttr(), 20.955),
        ("vertical_aperture", schema.GetVerticalApertureAttr(), 15.2908),
    ):
        value = float(context.get(attribute, default))
        if not (math.isfinite(value) and value > 0):
            context.warn(prim.GetPath(), f"{attribute.GetName()} must be > 0, got {value}. {default} is used.")
            value = default
        values[name] = value
    for name, attribute in (
        ("horizontal_offset", schema.GetHorizontalApertureOffsetAttr()),
        ("vertical_offset", schema.GetVerticalApertureOffsetAttr()),
    ):
        value = float(context.get(attribute, 0.0))
        if not math.isfinite(value):
            context.warn(prim.GetPath(), f"{attribute.GetName()} must be finite, got {value}. 0 is used.")
            value = 0.0
        values[name] = value

    near, far = (float(v) * float(scale[2]) for v in context.get(schema.GetClippingRangeAttr(), (1.0, 1e6)))
    is_orthographic = context.get(schema.GetProjectionAttr()) == UsdGeom.Tokens.orthographic
    near = max(near, 0.0) if is_orthographic else near
    if not (math.isfinite(near) and far > near and (near > 0 or is_orthographic)):
        context.warn(
            prim.GetPath(), f"clippingRange must be 0 < near < far, got ({near}, {far}) m. Nothing is clipped."
        )
        near, far = 1e-4, 1e12
    if context.get(schema.GetClippingPlanesAttr()):
        context.warn(prim.GetPath(), "clippingPlanes are not supported. They are left out.")
    if context.get(schema.GetFStopAttr(), 0.0):
        context.warn(prim.GetPath(), "depth of field (fStop) is not supported. Everything is sharp.")
    if context.get(schema.GetShutterOpenAttr(), 0.0) != context.get(schema.GetShutterCloseAttr(), 0.0):
        context.warn(prim.GetPath(), "motion blur (shutter) is not supported. The frame stands still.")
    return Camera(
        matrix=rigid,
        is_orthographic=is_orthographic,
        aperture_scale=float(_APERTURE_UNIT * scale[0]),
        clipping=(near, far),
        path=str(prim.GetPath()),
        **values,
    )


_BOX_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)


def box_corners(scene: Scene) -> np.ndarray:
    """The corners (8N, 3) of every object's box in the world, metres."""
    boxes: dict[int, np.ndarray] = {}
    corners = [np.zeros((0, 3))]
    for item in scene.objects:
        if item.mesh not in boxes:
            positions = scene.mesh(item.mesh).positions
            low, high = positions.min(axis=0), positions.max(axis=0)
            boxes[item.mesh] = np.where(_BOX_CORNERS, high, low).astype(np.float64)
        matrix = item.matrix
        corners.append(boxes[item.mesh] @ matrix[:3, :3] + matrix[3, :3])
    return np.concatenate(corners)


def frame_scene(scene: Scene) -> Camera:
    """A camera in front of the scene, a little above and to the right, that sees all of it and little else."""
    places = _outline(scene)
    if len(places) == 0:
        places = np.zeros((1, 3))
    backwards = np.array([0.45, 0.35, 1.0])
    backwards /= np.linalg.norm(backwards)
    right = np.cross([0.0, 1.0, 0.0], backwards)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(backwards, right), backwards])

    # A place (x, y, z) is within the picture where |x - cx| <= t (d - z), likewise y: the nearest d and its centre.
    focal_length, width = 50.0, 20.955
    height = width * 9 / 16
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    local = (places - middle) @ axes.T
    slope = np.array([width, height]) / (2 * focal_length) / 1.1  # a tenth more than the scene
    above = (local[:, :2] + slope * local[:, 2:]).max(axis=0)
    below = (-local[:, :2] + slope * local[:, 2:]).max(axis=0)
    nearest = float(local[:, 2].max())
    size = float(np.linalg.norm(local, axis=1).max())
    distance = max(float(((above + below) / (2 * slope)).max()), nearest + 1e-3 * size, 1e-3)
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[3, :3] = middle + np.array([*((above - below) / 2), distance]) @ axes
    return Camera(
        matrix=matrix,
        focal_length=focal_length,
        horizontal_aperture=width,
        vertical_aperture=height,
        clipping=(min(1e-3 * distance, 0.5 * max(distance - nearest, 1e-6)), 2 * (distance + size)),
        path="/framing_camera",
    )


def _outline(scene: Scene) -> np.ndarray:
    """Places (N, 3) that hold the scene: every vertex where they are few enough, else the corners of the boxes."""
    if sum(len(scene.mesh(item.mesh).positions) for item in scene.objects) > _MOST_FRAMED_VERTICES:
        return box_corners(scene)
    parts = [np.zeros((0, 3))]
    for item in scene.objects:
        mesh, matrix = scene.mesh(item.mesh), item.matrix
        used = mesh.positions[np.unique(mesh.triangles)].astype(np.float64)
        parts.append(used @ matrix[:3, :3] + matrix[3, :3])
    return np.concatenate(parts)
