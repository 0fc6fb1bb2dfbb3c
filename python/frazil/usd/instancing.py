"""The walk over a stage: every visible leaf as an object; native instances and PointInstancers share meshes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade

from .._frazil import Scene
from .context import ReadContext, are_singular, to_array
from .displacement import SurfaceDisplacement, displace
from .geometry import MeshPart, material_subsets, read_mesh
from .gprims import read_gprim
from .lights import LightReader, is_light
from .linking import LinkReader
from .materials import MaterialReader

_GPRIMS = frozenset({"Sphere", "Cube", "Cone", "Cylinder", "Cylinder_1", "Capsule", "Capsule_1", "Plane"})
_MOST_INSTANCES = 10_000_000  # of one PointInstancer, those of what holds it multiplied in

# What a stage shows: active, loaded, defined, not abstract; and inside native instances too.
_STAGE_PRIMS = Usd.TraverseInstanceProxies()
# Prototypes of a PointInstancer may be overs or classes, so that nothing draws them on their own.
_PROTOTYPE_PRIMS = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)


class StageWalker:
    """Adds what it meets to a scene; each mesh, whoever instances it, once."""

    def __init__(self, context: ReadContext, scene: Scene) -> None:
        self._context = context
        self._scene = scene
        self._materials = MaterialReader(context, scene)
        self._links = LinkReader(context)
        self._lights = LightReader(context, scene, self._links)
        self._meshes: dict[tuple, list[tuple[int, str]]] = {}

    def walk(self) -> None:
        """Add every leaf of the stage."""
        context = self._context
        for prim in self._leaves(context.stage.GetPseudoRoot(), _STAGE_PRIMS):
            matrix = context.local_to_world(prim)
            self._place(prim, matrix[None], [str(prim.GetPath())], inside=())
        self._lights.add_to_scene()

    def mattes(self) -> dict[str, list[int]]:
        """The objects of the stage's collections ``matte:NAME``, by NAME; after walk()."""
        return self._links.mattes()

    def _leaves(self, root: Usd.Prim, predicate) -> Iterator[Usd.Prim]:
        """Geometry, lights and PointInstancers under (and at) root that are visible and of a wanted purpose."""
        context = self._context
        prims = iter(Usd.PrimRange(root, predicate))
        for prim in prims:
            if prim.IsPseudoRoot():
                continue
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                if prim.IsA(UsdShade.Material):
                    prims.PruneChildren()
                elif prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaTypeName():
                    context.warn(prim.GetPath(), f"prims of type {prim.GetTypeName()} are not known. It is left out.")
                continue
            if context.get(imageable.GetVisibilityAttr()) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
                continue
            self._warn_of_unsupported(prim)
            is_instancer = prim.IsA(UsdGeom.PointInstancer)
            if is_instancer:
                prims.PruneChildren()
            if is_instancer or prim.IsA(UsdGeom.Gprim) or is_light(prim) or prim.GetTypeName() == "Volume":
                if imageable.ComputePurpose() in context.purposes:
                    yield prim

    def _warn_of_unsupported(self, prim: Usd.Prim) -> None:
        if prim.GetTypeName() == "SkelRoot":
            self._context.warn(prim.GetPath(), "skinning is not supported. Its meshes are rendered as authored.")
        if prim.HasAPI(UsdGeom.ModelAPI) and prim.IsModel():
            mode = UsdGeom.ModelAPI(prim).ComputeModelDrawMode()
            if mode in (UsdGeom.Tokens.cards, UsdGeom.Tokens.bounds, UsdGeom.Tokens.origin):
                self._context.warn(
                    prim.GetPath(), f"model:drawMode '{mode}' is not supported. Its full geometry is rendered."
                )

    def _place(self, prim: Usd.Prim, matrices: np.ndarray, paths: list[str], inside: tuple[str, ...]) -> None:
        """Add the leaf once per matrix (N, 4, 4), prim to world, under the N names; a warning where it is broken."""
        try:
            self._place_unchecked(prim, matrices, paths, inside)
        except (ValueError, TypeError, Tf.ErrorException) as error:
            # One broken prim must not lose the scene.
            said = " ".join(str(error).removeprefix(f"{prim.GetPath()}: ").split())
            self._context.warn(prim.GetPath(), f"{said} It is left out.")

    def _place_unchecked(self, prim: Usd.Prim, matrices: np.ndarray, paths: list[str], inside: tuple[str, ...]) -> None:
        if prim.IsA(UsdGeom.PointInstancer):
            self._place_instancer(prim, matrices, paths, inside)
        elif prim.IsA(UsdGeom.Gprim):
            self._place_geometry(prim, matrices, paths, inside)
        elif is_light(prim):
            for matrix, path in zip(matrices, paths, strict=True):
                self._lights.read(prim, matrix, path)
        else:
            self._warn_of_type(prim)

    def _warn_of_type(self, prim: Usd.Prim) -> None:
        self._context.warn(prim.GetPath(), f"prims of type {prim.GetTypeName()} are not supported. It is left out.")

    # -- geometry

    def _place_geometry(self, prim: Usd.Prim, matrices: np.ndarray, paths: list[str], inside: tuple[str, ...]) -> None:
        kind = prim.GetTypeName()
        if not (prim.IsA(UsdGeom.Mesh) or kind in _GPRIMS):
            self._warn_of_type(prim)
            return
        materials = {"": self._materials.bound_to(prim)}
        if prim.IsA(UsdGeom.Mesh):
            for subset in material_subsets(prim):
                materials[subset.GetPrim().GetName()] = self._materials.bound_to(subset.GetPrim())
        texcoord_name = next((m.texcoord_name for m in materials.values() if m.texcoord_name), None)
        displacements = {key: m.displacement for key, m in materials.items() if m.displacement is not None}
        metres_per_unit = abs(np.linalg.det(matrices[0][:3, :3])) ** (1 / 3) if len(matrices) else 1.0
        parts = self._mesh_parts(prim, texcoord_name, displacements, metres_per_unit)
        if not parts:
            return
        asset, together = _asset_of(prim), _translucency_set_of(prim)
        for matrix, path, is_flat in zip(matrices, paths, are_singular(matrices), strict=True):
            if is_flat:
                self._context.warn(path, "its transform cannot be inverted (a scale of 0?). It is left out.")
                continue
            for mesh, subset in parts:
                name = f"{path}/{subset}" if subset else path
                matrix = np.ascontiguousarray(matrix)
                index = self._scene.add_object(name, mesh, materials[subset].index, matrix, asset, together)
                own = [prim.GetPath().AppendChild(subset)] if subset else []
                self._links.add_object([*own, prim.GetPath(), *reversed([Sdf.Path(name) for name in inside])])
                if is_light(prim):
                    self._lights.read_mesh(prim, matrix, name, index)

    def _mesh_parts(
        self,
        prim: Usd.Prim,
        texcoord_name: str | None,
        displacements: dict[str, SurfaceDisplacement],
        metres_per_unit: float,
    ) -> list[tuple[int, str]]:
        """Indices of the prim's meshes in the scene and the subsets that they belong to; read on first use.

        Displaced meshes of one prototype are shared too: heights are those of its first place.
        """
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        moved = tuple(sorted((name, surface.path) for name, surface in displacements.items()))
        key = (str(source.GetPath()), texcoord_name, moved)
        if key not in self._meshes:
            self._meshes[key] = []  # stays so where reading fails, so that it is tried once
            if prim.IsA(UsdGeom.Mesh):
                parts = read_mesh(self._context, prim, texcoord_name, displacements, metres_per_unit)
            else:
                mesh = read_gprim(self._context, prim)
                if displacements and metres_per_unit > 0.0:
                    owner = np.full(len(mesh.triangles), -1, np.int32)
                    faces = np.arange(len(owner), dtype=np.int32)
                    of_owner = {-1: displacements[""]} if "" in displacements else {}
                    mesh, _ = displace(self._context, prim.GetPath(), mesh, faces, owner, of_owner, metres_per_unit)
                parts = [MeshPart(mesh)]
            self._meshes[key] = [(self._scene.add_mesh(p.mesh, str(prim.GetPath())), p.subset) for p in parts]
        return self._meshes[key]

    # -- PointInstancer

    def _place_instancer(self, prim: Usd.Prim, matrices: np.ndarray, paths: list[str], inside: tuple[str, ...]) -> None:
        context = self._context
        if str(prim.GetPath()) in inside:
            context.warn(prim.GetPath(), "is a PointInstancer that instances itself. It is left out there.")
            return
        inside = (*inside, str(prim.GetPath()))
        roots = self._prototype_roots(prim)
        numbers, own, prototypes = self._instances(prim, roots)
        if len(numbers) * len(paths) > _MOST_INSTANCES:
            asked = len(numbers) * len(paths)
            context.warn(
                prim.GetPath(), f"must have at most {_MOST_INSTANCES} instances in all, got {asked}. It is left out."
            )
            return
        for index, root in enumerate(roots):
            chosen = np.flatnonzero(prototypes == index)
            if root is None or len(chosen) == 0:
                continue
            # instance to world, for every place that the instancer itself has
            placed = (own[chosen][None] @ matrices[:, None]).reshape(-1, 4, 4)
            names = [f"{path}[{numbers[i]}]" for path in paths for i in chosen]
            prefix = len(str(root.GetPath().GetParentPath()).rstrip("/"))
            for leaf in self._leaves(root, _PROTOTYPE_PRIMS):
                relative, _ = context.transforms.ComputeRelativeTransform(leaf, root)
                suffix = str(leaf.GetPath())[prefix:]
                self._place(leaf, to_array(relative) @ placed, [name + suffix for name in names], inside)

    def _prototype_roots(self, prim: Usd.Prim) -> list[Usd.Prim | None]:
        roots: list[Usd.Prim | None] = []
        for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets():
            root = self._context.stage.GetPrimAtPath(target)
            if not root:
                self._context.warn(prim.GetPath(), f"prototype <{target}> does not exist. Its instances are left out.")
            elif prim.GetPath().HasPrefix(target):
                self._context.warn(prim.GetPath(), f"prototype <{target}> holds the instancer itself. It is left out.")
                root = None
            roots.append(root or None)
        return roots

    def _instances(self, prim: Usd.Prim, roots: list) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers, transforms (root prim's own included) and prototypes of the instances that are shown."""
        context = self._context
        instancer = UsdGeom.PointInstancer(prim)
        nothing = np.zeros(0, int), np.zeros((0, 4, 4)), np.zeros(0, int)
        prototypes = np.asarray(context.get(instancer.GetProtoIndicesAttr(), []), dtype=np.int64)
        positions = context.get(instancer.GetPositionsAttr(), [])
        if len(prototypes) == 0:
            context.warn(prim.GetPath(), "is a PointInstancer without instances. It is left out.")
            return nothing
        if len(positions) != len(prototypes):
            context.warn(
                prim.GetPath(),
                f"positions must have {len(prototypes)} values (one per protoIndices), got {len(positions)}. "
                f"It is left out.",
            )
            return nothing
        is_known = (prototypes >= 0) & (prototypes < len(roots))
        if not is_known.all():
            wrong = prototypes[~is_known][0]
            context.warn(
                prim.GetPath(),
                f"protoIndices must be in 0..{len(roots) - 1}, got {wrong}. Those instances are left out.",
            )
        transforms = instancer.ComputeInstanceTransformsAtTime(
            context.time, context.time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        if len(transforms) != len(prototypes):
            context.warn(prim.GetPath(), "its arrays disagree in length. It is left out.")
            return nothing
        own = np.array(transforms, dtype=np.float64).reshape(-1, 4, 4)
        local = {
            i: to_array(context.transforms.GetLocalTransformation(root)[0])
            for i, root in enumerate(roots)
            if root is not None
        }
        for index, matrix in local.items():
            own[prototypes == index] = matrix @ own[prototypes == index]
        mask = instancer.ComputeMaskAtTime(context.time)
        if len(mask):
            is_known &= np.asarray(mask, dtype=bool)
        numbers = np.flatnonzero(is_known)
        return numbers, own[numbers], prototypes[numbers]


def _translucency_set_of(prim: Usd.Prim) -> str:
    """The set whose ice shares its light: ``frazil:translucencySet`` of the prim or the nearest above that has one."""
    above = prim
    while above and not above.IsPseudoRoot():
        value = above.GetAttribute("frazil:translucencySet").Get()
        if value:
            return str(value)
        above = above.GetParent()
    return ""


def _asset_of(prim: Usd.Prim) -> str:
    """The path of what a leaf belongs to: the nearest instance or component, else what stands below the root prim."""
    above = prim
    while above and not above.IsPseudoRoot():
        if above.IsInstance() or Usd.ModelAPI(above).IsKind("component"):
            return str(above.GetPath())
        above = above.GetParent()
    prefixes = prim.GetPath().GetPrefixes()
    return str(prefixes[min(1, len(prefixes) - 1)])
