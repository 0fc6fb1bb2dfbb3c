"""A small scene made in Python: a ball of ice over a floor, under lights of two groups."""

import numpy as np
import trimesh

import frazil as fz


def placed(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A matrix for row vectors that moves by (x, y, z) metres."""
    matrix = np.eye(4)
    matrix[3, :3] = (x, y, z)
    return matrix


def ice_over_floor(key: float = 40.0, sky: float = 0.4, radius: float = 1.0, camera_x: float = 0.0, **look) -> fz.Scene:
    """The scene; `key` and `sky` are radiances, `camera_x` moves the camera alone, `look` is of IceMaterial."""
    scene = fz.Scene()
    ball = trimesh.creation.icosphere(3, radius)
    ice = fz.Mesh(np.asarray(ball.vertices, np.float32), np.asarray(ball.faces, np.int32))
    corners = np.array([[-4, -1, -4], [4, -1, -4], [4, -1, 4], [-4, -1, 4]], np.float32)
    floor = fz.Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]], np.int32))
    model = fz.IceMaterial(fz.Medium(sigma_s_prime=(8.0, 9.0, 10.0), sigma_a=(0.6, 0.2, 0.05)), **look)
    materials = [scene.add_material("/ice", model), scene.add_material("/grey", fz.StandardMaterial())]
    for path, mesh, material in (("/Ball", ice, materials[0]), ("/Floor", floor, materials[1])):
        scene.add_object(path, scene.add_mesh(mesh, path), material, placed())
    scene.add_light(fz.Light(fz.DomeLight(), radiance=(sky, sky, sky), path="/Sky", group="sky"))
    lamp = fz.Light(fz.SphereLight(0.2), radiance=(key, key, key), matrix=placed(2, 3, 1), path="/Key", group="key")
    scene.add_light(lamp)
    camera = fz.Camera()
    camera.matrix = placed(camera_x, 0, 9)
    scene.camera = camera
    return scene
