"""MaterialX documents as USD: materials for a stage that refers to .mtlx files, or that a document's look overrides.

Model: a document becomes a layer /MaterialX/Materials/NAME of UsdShade prims, as OpenUSD's own reader lays it out, so
that one reader of networks serves both. Nodes that a document defines by graphs of its own are flattened first.
Units: inputs with a unit of length are brought to the stage's; others are as authored, in scene units.
Not: the document's geometry, property sets, variants, and visibility.
"""

from __future__ import annotations

import math
from fnmatch import fnmatchcase
from pathlib import Path

import MaterialX as mx
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade

from .context import ReadContext
from .mtlx_library import library

_ROOT = "MaterialX"
_OVERRIDE_ROOT = "FrazilMaterials"  # where the materials of a look lie, so that they hide nothing of the stage
_METRES = {
    "meter": 1.0,
    "kilometer": 1000.0,
    "centimeter": 0.01,
    "millimeter": 0.001,
    "micron": 1e-6,
    "nanometer": 1e-9,
    "inch": 0.0254,
    "foot": 0.3048,
    "yard": 0.9144,
    "mile": 1609.344,
}
_VALUE_TYPES = Sdf.ValueTypeNames
_TYPES = {
    "float": _VALUE_TYPES.Float,
    "integer": _VALUE_TYPES.Int,
    "boolean": _VALUE_TYPES.Bool,
    "color3": _VALUE_TYPES.Color3f,
    "color4": _VALUE_TYPES.Color4f,
    "vector2": _VALUE_TYPES.Float2,
    "vector3": _VALUE_TYPES.Float3,
    "vector4": _VALUE_TYPES.Float4,
    "string": _VALUE_TYPES.String,
    "filename": _VALUE_TYPES.Asset,
    "floatarray": _VALUE_TYPES.FloatArray,
    "color3array": _VALUE_TYPES.Color3fArray,
}


def read_document(path: str) -> mx.Document:
    """A .mtlx file, with the library beside it.

    OSError, beginning with the path, where it is missing or no MaterialX.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: no such MaterialX file.")
    document = mx.createDocument()
    try:
        mx.readFromXmlFile(document, path, mx.FileSearchPath(str(Path(path).parent)))
    except (mx.ExceptionParseError, mx.ExceptionFileMissing, RuntimeError, LookupError) as error:
        raise OSError(f"{path}: is not a readable MaterialX file: {' '.join(str(error).split())}") from error
    document.setDataLibrary(library())
    return document


def to_layer(context: ReadContext, document: mx.Document, path: str, root: str = _ROOT) -> Sdf.Layer:
    """The materials of a document, as an anonymous layer whose default prim is /`root`."""
    layer = Sdf.Layer.CreateAnonymous(f"{Path(path).stem}.usda")
    stage = Usd.Stage.Open(layer)
    stage.SetDefaultPrim(stage.DefinePrim(f"/{root}", "Scope"))
    stage.DefinePrim(f"/{root}/Materials", "Scope")
    is_valid, said = document.validate()
    if not is_valid:
        context.warn(path, f"MaterialX says: {' '.join(said.splitlines()[0].split())}")
    _flatten(document)
    for material in document.getMaterialNodes():
        _Material(context, stage, path, f"/{root}/Materials/{_identifier(material.getName())}").write(material)
    return layer


def _flatten(document: mx.Document) -> None:
    """Replace nodes that the document itself defines by the graphs that define them."""
    known = {d.getName() for d in document.getNodeDefs()} - {d.getName() for d in library().getNodeDefs()}

    def is_own(node: mx.Node) -> bool:
        definition = node.getNodeDef()
        return definition is not None and definition.getName() in known

    if not known:
        return
    for graph in [document, *document.getNodeGraphs()]:
        graph.flattenSubgraphs("", is_own)


class _Material:
    """Writes one material and all nodes that it reads."""

    def __init__(self, context: ReadContext, stage: Usd.Stage, path: str, prim_path: str) -> None:
        self._context, self._stage, self._path = context, stage, path
        self._folder = Path(path).parent
        self._material = UsdShade.Material.Define(stage, prim_path)
        self._nodes: dict[str, UsdShade.Shader] = {}

    def write(self, material: mx.Node) -> None:
        for name, output in (
            ("surfaceshader", self._material.CreateSurfaceOutput("mtlx")),
            ("displacementshader", self._material.CreateDisplacementOutput("mtlx")),
        ):
            source = self._source(material.getInput(name)) if material.getInput(name) is not None else None
            if source is not None:
                output.ConnectToSource(source)

    def _define(self, node: mx.Node) -> UsdShade.Shader | None:
        key = node.getNamePath()
        if key in self._nodes:
            return self._nodes[key]
        definition = _definition_of(node)
        name = self._material.GetPath()
        for part in key.split("/"):
            name = name.AppendChild(_identifier(part))
        parent = name.GetParentPath()
        while parent != self._material.GetPath():
            self._stage.DefinePrim(parent, "NodeGraph")
            parent = parent.GetParentPath()
        shader = UsdShade.Shader.Define(self._stage, name)
        self._nodes[key] = shader
        shader.CreateIdAttr(definition.getName() if definition is not None else f"ND_{node.getCategory()}")
        for node_input in node.getInputs():
            self._write_input(shader, node_input)
        return shader

    def _write_input(self, shader: UsdShade.Shader, node_input: mx.Input) -> None:
        if node_input.getType() in ("overlayshader", "densityshader", "surfaceshader"):
            kind = _VALUE_TYPES.Token
        else:
            kind = _TYPES.get(node_input.getType())
        if kind is None:
            return
        source = self._source(node_input)
        if source is not None:
            shader.CreateInput(node_input.getName(), kind).ConnectToSource(source)
            return
        holder = self._holder(node_input)
        if holder is None or not holder.getValueString():
            return
        value = self._value(holder)
        if value is None:
            self._context.warn(
                self._path, f"{holder.getNamePath()} must be a {holder.getType()}, got '{holder.getValueString()}'."
            )
            return
        attribute = shader.CreateInput(node_input.getName(), kind).GetAttr()
        attribute.Set(value)
        if node_input.getType() in ("filename", "color3", "color4"):
            # What the file, its graph or the document says.
            space = holder.getActiveColorSpace()
            if space:
                attribute.SetColorSpace(space)

    def _holder(self, node_input: mx.Input) -> mx.Input | None:
        """The input that has the value: through the inputs of graphs."""
        for _ in range(32):
            name = node_input.getInterfaceName()
            if not name:
                return node_input
            graph = _graph_of(node_input)
            found = graph.getInput(name) if graph is not None else None
            if found is None:
                definition = graph.getNodeDef() if graph is not None else None
                return definition.getActiveInput(name) if definition is not None else None
            node_input = found
        return None

    def _source(self, node_input: mx.Input | None) -> UsdShade.Output | None:
        """The output that feeds an input, or None where a value does."""
        holder = self._holder(node_input)
        if holder is None:
            return None
        for _ in range(32):
            if holder.getNodeName():
                node = self._sibling(holder, holder.getNodeName())
                break
            if not (holder.getNodeGraphString() or holder.getOutputString()):
                return None
            output = holder.getConnectedOutput() or _qualified_output(holder)
            if output is None:
                self._context.warn(
                    self._path, f"{holder.getNamePath()} is connected to an output that does not exist. It is left out."
                )
                return None
            if output.getNodeName():
                holder, node = output, self._sibling(output, output.getNodeName())
                break
            holder = output
        else:
            return None
        if node is None:
            self._context.warn(
                self._path,
                f"{holder.getNamePath()} is connected to '{holder.getNodeName()}', which does not exist. "
                "It is left out.",
            )
            return None
        shader = self._define(node)
        return shader.CreateOutput(holder.getOutputString() or "out", _VALUE_TYPES.Token)

    def _sibling(self, element: mx.Element, name: str) -> mx.Node | None:
        # The inputs of a graph are fed by what stands beside it.
        inside = element.getParent().getParent() if isinstance(element.getParent(), mx.NodeGraph) else element
        graph = _graph_of(inside if isinstance(element, mx.Input) else element) or element.getDocument()
        return graph.getNode(name) or graph.getNode(element.getQualifiedName(name))

    def _value(self, holder: mx.Input):
        kind, text = holder.getType(), holder.getValueString()
        if kind == "filename":
            return Sdf.AssetPath(self._find_file(holder, holder.getActiveFilePrefix() + text))
        if kind == "color3array":
            numbers = [float(number) for number in text.replace(",", " ").split()]
            return [Gf.Vec3f(*numbers[i : i + 3]) for i in range(0, len(numbers) - 2, 3)]
        value = holder.getValue()
        if value is None:
            return None
        if hasattr(value, "asTuple"):
            value = value.asTuple()
        factor = self._factor(holder)
        if kind == "float":
            return float(value) * factor
        if kind in ("color3", "vector3"):
            return Gf.Vec3f(*(v * factor for v in value))
        if kind == "vector2":
            return Gf.Vec2f(*(v * factor for v in value))
        if kind in ("color4", "vector4"):
            return Gf.Vec4f(*value)
        if kind == "floatarray":
            return [float(v) * factor for v in value]
        return value

    def _find_file(self, holder: mx.Input, name: str) -> str:
        """Beside the document, else beside the one that it includes the input from."""
        beside = self._folder / name
        included = self._folder / Path(holder.getActiveSourceUri()).parent / name
        return str(included if included != beside and not _is_there(beside) and _is_there(included) else beside)

    def _factor(self, holder: mx.Input) -> float:
        """Scene units per authored unit of length, degrees per authored unit of angle."""
        unit = holder.getUnit()
        if not unit or unit == "degree":
            return 1.0
        if unit == "radian":
            return math.degrees(1.0)
        if unit in _METRES:
            return _METRES[unit] / self._context.meters_per_unit
        name = holder.getNamePath()
        self._context.warn(self._path, f"{name} has the unit '{unit}', which is not known. It is ignored.")
        return 1.0


def _definition_of(node: mx.Node) -> mx.NodeDef | None:
    """What defines a node; one of its name and type where its inputs fit none, so that only those are left out."""
    found = node.getNodeDef()
    if found is not None:
        return found
    alike = [d for d in library().getMatchingNodeDefs(node.getCategory()) if d.getType() == node.getType()]

    def misfits(definition: mx.NodeDef) -> int:
        types = {i.getName(): i.getType() for i in definition.getActiveInputs()}
        return sum(types.get(i.getName()) != i.getType() for i in node.getInputs())

    # The default version wins among those that fit as well.
    return min(alike, key=lambda d: (misfits(d), not d.getDefaultVersion()), default=None)


def _identifier(name: str) -> str:
    """A name of MaterialX's, which may have a namespace, as one of USD's: acme:Ice -> acme_Ice."""
    return Tf.MakeValidIdentifier(name)


def _is_there(path: Path) -> bool:
    """Whether there is such a file; a pattern of tiles counts by its folder's files."""
    return path.is_file() or ("<" in path.name and any(path.parent.glob(path.name.partition("<")[0] + "*")))


def _qualified_output(holder: mx.Input) -> mx.Output | None:
    """The output of a graph that is named without its namespace."""
    document = holder.getDocument()
    graph = document.getNodeGraph(holder.getQualifiedName(holder.getNodeGraphString()))
    if graph is None:
        return None
    return graph.getOutput(holder.getOutputString()) if holder.getOutputString() else (graph.getOutputs() or [None])[0]


def _graph_of(element: mx.Element) -> mx.NodeGraph | None:
    """The node graph that an element is in."""
    while element is not None and not isinstance(element, mx.NodeGraph):
        element = element.getParent()
    return element


# -- stages


def compose_references(context: ReadContext) -> None:
    """Bring in the .mtlx files that a stage refers to, which USD without its MaterialX plug-in cannot read."""
    stage = context.stage
    if not any(_is_mtlx(name) for layer in stage.GetUsedLayers() for name in layer.GetCompositionAssetDependencies()):
        return
    layers: dict[str, Sdf.Layer | None] = {}
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for prim in list(Usd.PrimRange.Stage(stage, Usd.PrimAllPrimsPredicate)):
            wanted = [
                (spec.layer, arc)
                for spec in prim.GetPrimStack()
                for arcs in (spec.referenceList, spec.payloadList)
                for arc in arcs.GetAddedOrExplicitItems()
                if _is_mtlx(arc.assetPath)
            ]
            for layer, arc in wanted:
                path = layer.ComputeAbsolutePath(arc.assetPath)
                if path not in layers:
                    layers[path] = _open_layer(context, prim, path)
                if layers[path] is not None:
                    over = stage.OverridePrim(prim.GetPath())
                    over.GetReferences().AddReference(layers[path].identifier, arc.primPath)
    context.layers += [layer for layer in layers.values() if layer is not None]


def _is_mtlx(name: str) -> bool:
    return name.lower().endswith(".mtlx")


def _open_layer(context: ReadContext, prim: Usd.Prim, path: str) -> Sdf.Layer | None:
    try:
        return to_layer(context, read_document(path), path)
    except OSError as error:
        context.warn(prim.GetPath(), f"{error} The reference is left out.")
        return None


def override_materials(context: ReadContext, path: str, look: str | None = None) -> None:
    """Bind the materials of a document to a stage's geometry, as one of its looks assigns them.

    OSError where the file cannot be read; ValueError where it has no such look.
    """
    document = read_document(path)
    looks = document.getLooks()
    if look is not None and document.getLook(look) is None:
        names = ", ".join(sorted(item.getName() for item in looks)) or "none"
        raise ValueError(f"{path}: look must be one of {names}, got '{look}'.")
    chosen = document.getLook(look) if look is not None else (looks[0] if looks else None)
    if chosen is None:
        raise ValueError(f"{path}: the document must have a look that assigns materials, got none. Add a <look>.")
    layer = to_layer(context, document, path, _OVERRIDE_ROOT)
    context.layers.append(layer)
    stage = context.stage
    stage.GetSessionLayer().subLayerPaths.append(layer.identifier)
    for variant in chosen.getActiveVariantAssigns():
        context.warn(path, f"{variant.getNamePath()} chooses a variant, which is not supported. It is left out.")
    assigns = [(a, _Geometry(a)) for a in chosen.getActiveMaterialAssigns()]
    used: set[str] = set()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for prim in list(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())):
            if not (prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)):
                continue
            name = str(prim.GetPath())
            fitting = next((a for a, geometry in reversed(assigns) if geometry.has(name)), None)
            if fitting is None:
                continue
            used.add(fitting.getNamePath())
            if prim.IsInstanceProxy():
                context.warn(name, f"is inside an instance, so that {path} cannot change its material.")
                continue
            target = stage.GetPrimAtPath(f"/{_OVERRIDE_ROOT}/Materials/{_identifier(fitting.getMaterial())}")
            if not target:
                context.warn(path, f"{fitting.getNamePath()} assigns '{fitting.getMaterial()}', which does not exist.")
                continue
            UsdShade.MaterialBindingAPI.Apply(prim).Bind(
                UsdShade.Material(target), UsdShade.Tokens.strongerThanDescendants
            )
    for assign, _ in assigns:
        if assign.getNamePath() not in used:
            context.warn(path, f"{assign.getNamePath()} fits no geometry of the stage.")


class _Geometry:
    """The prims that a material is assigned to: paths, with what lies below, and wildcards."""

    def __init__(self, assign: mx.MaterialAssign) -> None:
        self._named = [assign.getActiveGeomPrefix() + name for name in _split(assign.getGeom())]
        self._collection = assign.getCollection()

    def has(self, path: str) -> bool:
        return _fits(self._named, path) or _is_in(self._collection, path, set())


def _is_in(collection: mx.Collection | None, path: str, seen: set[str]) -> bool:
    """Whether a collection, or one that it includes, has the path; none is looked into twice."""
    if collection is None or collection.getName() in seen:
        return False
    seen.add(collection.getName())
    is_included = _fits(_split(collection.getIncludeGeom()), path) or any(
        _is_in(collection.getDocument().getCollection(name), path, seen)
        for name in _split(collection.getIncludeCollectionString())
    )
    return is_included and not _fits(_split(collection.getExcludeGeom()), path)


def _split(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _fits(patterns: list[str], path: str) -> bool:
    return any(
        pattern in ("/", "*") or path == pattern or path.startswith(pattern.rstrip("/") + "/")
        if not any(c in pattern for c in "*?[")
        else fnmatchcase(path, pattern) or fnmatchcase(path, pattern + "/*")
        for pattern in patterns
    )
