"""UsdRenderSettings, products and vars, as plain data for the caller: what to render where."""

from __future__ import annotations

from dataclasses import dataclass, field

from pxr import Usd, UsdRender

from .context import ReadContext


@dataclass
class RenderVar:
    """One layer that is asked for: `source_name` is the AOV."""

    path: str
    source_name: str
    data_type: str
    source_type: str = "raw"

    @property
    def layer(self) -> str:
        """What the layer of a light path expression is called: the last name of the prim's path."""
        return self.path.rpartition("/")[2]


@dataclass
class RenderProduct:
    """One file that is asked for. `resolution` and `camera` are the settings' where it has none of its own."""

    path: str
    name: str
    resolution: tuple[int, int] | None
    camera: str | None
    vars: list[RenderVar] = field(default_factory=list)


@dataclass
class RenderSettings:
    """What the stage asks of a renderer; None = not authored."""

    path: str
    resolution: tuple[int, int] | None = None
    pixel_aspect_ratio: float = 1.0
    camera: str | None = None
    data_window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    products: list[RenderProduct] = field(default_factory=list)

    @property
    def product(self) -> RenderProduct:
        """The one that is rendered: the first, or one that asks for what the settings ask for."""
        return self.products[0] if self.products else RenderProduct(self.path, "", self.resolution, self.camera)


def read_render_settings(context: ReadContext) -> RenderSettings | None:
    """The stage's render settings: those that its metadata name, else the only ones; None where there are none."""
    settings = UsdRender.Settings.GetStageRenderSettings(context.stage)
    if not settings:
        found = [p for p in context.stage.Traverse() if p.IsA(UsdRender.Settings)]
        if not found:
            return None
        if len(found) > 1:
            context.warn(found[0].GetPath(), "is used, the first of several render settings.")
        settings = UsdRender.Settings(found[0])
    resolution = _resolution(context, settings)
    ratio = float(context.get(settings.GetPixelAspectRatioAttr(), 1.0))
    if not ratio > 0:
        context.warn(settings.GetPath(), f"pixelAspectRatio must be > 0, got {ratio}. 1 is used.")
        ratio = 1.0
    camera = _target(settings.GetCameraRel())
    result = RenderSettings(
        str(settings.GetPath()),
        resolution,
        ratio,
        camera,
        tuple(float(v) for v in context.get(settings.GetDataWindowNDCAttr(), (0, 0, 1, 1))),
    )
    for target in settings.GetProductsRel().GetForwardedTargets():
        product = UsdRender.Product(context.stage.GetPrimAtPath(target))
        if not product:
            context.warn(settings.GetPath(), f"names the product <{target}>, which does not exist.")
            continue
        result.products.append(_read_product(context, product, resolution, camera))
    _warn_of_unsupported(context, settings, result)
    return result


def _warn_of_unsupported(context: ReadContext, settings: UsdRender.Settings, read: RenderSettings) -> None:
    """Name what a render leaves to its own options."""
    path = read.path
    if read.pixel_aspect_ratio != 1.0:
        context.warn(path, f"pixelAspectRatio {read.pixel_aspect_ratio:g} is not supported. Pixels are square.")
    if read.data_window != (0.0, 0.0, 1.0, 1.0):
        context.warn(path, "dataWindowNDC is not supported. The whole picture is rendered.")
    purposes = context.get(settings.GetIncludedPurposesAttr())
    if purposes and not set(purposes) <= context.purposes:
        left_out = ", ".join(sorted(set(purposes) - context.purposes))
        context.warn(path, f"includedPurposes asks for {left_out}, which is left out. Load with these purposes.")
    for product in read.products[1:]:
        context.warn(product.path, "is left out: one product is rendered, the first.")
    for product in read.products[:1]:
        if product.name:
            context.warn(product.path, f"productName '{product.name}' is not used. The caller names the file.")


def _read_product(context: ReadContext, product: UsdRender.Product, resolution, camera) -> RenderProduct:
    kind = context.get(product.GetProductTypeAttr(), "raster")
    if kind != "raster":
        context.warn(product.GetPath(), f"productType must be raster, got '{kind}'. It is taken as raster.")
    result = RenderProduct(
        str(product.GetPath()),
        str(context.get(product.GetProductNameAttr(), "")),
        _resolution(context, product) or resolution,
        _target(product.GetCameraRel()) or camera,
    )
    for target in product.GetOrderedVarsRel().GetForwardedTargets():
        var = UsdRender.Var(context.stage.GetPrimAtPath(target))
        if not var:
            context.warn(product.GetPath(), f"names the render var <{target}>, which does not exist.")
            continue
        source = str(context.get(var.GetSourceTypeAttr(), "raw"))
        name = str(context.get(var.GetSourceNameAttr(), "") or var.GetPrim().GetName())
        result.vars.append(
            RenderVar(str(var.GetPath()), name, str(context.get(var.GetDataTypeAttr(), "color3f")), source)
        )
    return result


def _resolution(context: ReadContext, settings: UsdRender.SettingsBase) -> tuple[int, int] | None:
    attribute = settings.GetResolutionAttr()
    if not attribute.HasAuthoredValue():
        return None
    width, height = (int(v) for v in context.get(attribute, (0, 0)))
    if width < 1 or height < 1:
        context.warn(settings.GetPath(), f"resolution must be at least 1x1, got {width}x{height}. It is left out.")
        return None
    return width, height


def _target(relationship: Usd.Relationship) -> str | None:
    targets = relationship.GetForwardedTargets()
    return str(targets[0]) if targets else None
