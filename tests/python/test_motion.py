"""Motion vectors point to where the same place of a surface is in the next frame's picture."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

import frazil as fz

SIZE = (48, 32)


def project(camera, positions):
    """Pixels, x to the right, y upwards, of (..., 3) world positions: by the definition of UsdGeomCamera."""
    local = np.concatenate([positions, np.ones((*positions.shape[:-1], 1))], axis=-1) @ np.linalg.inv(camera.matrix)
    # The picture is wider than the aperture, which expands.
    scale = camera.focal_length / camera.vertical_aperture * SIZE[1]
    return local[..., :2] / -local[..., 2:3] * scale


def stage(path, *, moves=True, bends=False, camera_moves=False):
    """A cube, or a square whose vertices move, before a camera; Z up and centimetres, for the units' sake."""
    made = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(made, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(made, 0.01)
    made.SetStartTimeCode(1)
    made.SetEndTimeCode(10)
    mesh = UsdGeom.Mesh.Define(made, "/World/Square")
    mesh.CreateSubdivisionSchemeAttr("none")
    corners = [(-50, 0, -50), (50, 0, -50), (50, 0, 50), (-50, 0, 50)]
    mesh.CreatePointsAttr(corners)
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    if bends:
        points = mesh.GetPointsAttr()
        points.Set(corners, 1)
        points.Set([(x * 1.1, y, z) for x, y, z in corners], 2)
    if moves:
        move = mesh.AddTranslateOp()
        move.Set(Gf.Vec3d(0, 0, 0), 1)
        move.Set(Gf.Vec3d(10, 0, 5), 2)
        turn = mesh.AddRotateZOp()
        turn.Set(0.0, 1)
        turn.Set(10.0, 2)
    camera = UsdGeom.Camera.Define(made, "/World/Camera")
    camera.CreateFocalLengthAttr(30)
    place = camera.AddTranslateOp()
    place.Set(Gf.Vec3d(0, -300, 0), 1)
    if camera_moves:
        place.Set(Gf.Vec3d(20, -280, 10), 2)
    camera.AddRotateXOp().Set(90)
    made.GetRootLayer().Save()
    return path


def motion_of(path, **options):
    scene = fz.load_usd(path, frame=1)
    fz.add_motion(scene)
    film = fz.render(scene, resolution=SIZE, samples=4, aovs=["motion", "Pref"], **options)
    return scene, film


@pytest.mark.parametrize(
    "what", [{}, {"moves": False, "bends": True}, {"moves": False, "camera_moves": True}, {"camera_moves": True}]
)
def test_vectors_are_the_way_between_two_projections(tmp_path, what):
    path = stage(tmp_path / "moves.usda", **what)
    scene, film = motion_of(path)
    later = fz.load_usd(path, frame=2)
    shown = film["object_id"][:, :, 0] > 0
    assert 100 < shown.sum() < shown.size
    local = film["Pref"][shown].astype(np.float64)
    if what.get("bends"):
        local_next = local * [1.1, 1, 1]
    else:
        local_next = local
    ones = np.ones((len(local), 1))
    now = np.concatenate([local, ones], 1) @ scene.objects[0].matrix
    then = np.concatenate([local_next, ones], 1) @ later.objects[0].matrix
    expected = project(later.camera, then[:, :3]) - project(scene.camera, now[:, :3])
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(film["motion"][shown], expected, atol=2e-3)


def test_backgrounds_move_with_the_cameras_turn(tmp_path):
    path = stage(tmp_path / "turns.usda", moves=False)
    made = Usd.Stage.Open(str(path))
    camera = UsdGeom.Camera.Get(made, "/World/Camera")
    turn = camera.AddRotateYOp()
    turn.Set(0.0, 1)
    turn.Set(1.0, 2)
    made.GetRootLayer().Save()
    scene, film = motion_of(path)
    background = film["object_id"][:, :, 0] == 0
    middle = film["motion"][SIZE[1] // 2][background[SIZE[1] // 2]]
    # One degree to the left, so that the picture goes to the right by about focal length times its tangent.
    pixels = np.tan(np.radians(1.0)) * 30 / scene.camera.vertical_aperture * SIZE[1]
    assert np.all(middle[:, 0] > 0.95 * pixels)
    assert np.all(middle[:, 0] < 1.5 * pixels)
    np.testing.assert_allclose(middle[:, 1], 0.0, atol=0.05)


def test_without_time_or_motion_everything_stands_still(tmp_path):
    scene, film = motion_of(stage(tmp_path / "still.usda", moves=False))
    assert not film["motion"].any()
    plain = fz.load_usd(tmp_path / "still.usda")
    assert not fz.render(plain, resolution=SIZE, samples=1, aovs=["motion"])["motion"].any()
    still = Usd.Stage.CreateNew(str(tmp_path / "timeless.usda"))
    UsdGeom.Cube.Define(still, Sdf.Path("/Cube"))
    still.GetRootLayer().Save()
    assert not motion_of_timeless(tmp_path / "timeless.usda").any()


def motion_of_timeless(path):
    scene = fz.load_usd(path)
    fz.add_motion(scene)
    return fz.render(scene, resolution=SIZE, samples=1, aovs=["motion"])["motion"]
