"""`denoise_film`: Open Image Denoise on the ray-traced layers, each by itself, so that they still sum to the beauty.

Model: translucency comes from points, so it stays as it is; so do emission and background. Every other additive layer
is denoised apart, per light group where there are groups, guided by albedo and normal (which are taken for clean);
layers and beauty are summed anew. What reflects is denoised as if it filled the pixels of silhouettes and went on
beyond, and then covers as much of them as before, as the denoiser gives coloured fringes to edges beyond which there is
nothing. Where light is seen through ice, a path gives what it does not let through to the core: what translucency lacks
in a pixel, refraction and volume have there, as the guides do not tell. So these are denoised with translucency as
well, and what that sum has in a pixel beyond the parts is theirs.
Valid: where negative lights make a layer negative, its positive and its negative part are denoised apart. A layer with
light in pixels that nothing covers is denoised as it is, silhouettes too.
Not: fringes of what is seen through ice, which filled its pixels would keep single bright paths, and those of edges
between bodies. Animation; every frame is on its own.
"""

from typing import Any

import numpy as np

from .film import Film

__all__ = ["check_denoiser", "denoise_film"]

NOISELESS = ("translucency", "emission", "background")
SEEN_THROUGH = ("refraction", "volume")
# Of the denoiser, 2.4 times as fast as its best: 1 to 2 % more error in what reflects, 5 % in what is seen through ice.
QUALITY = "balanced"
# Of a pixel's light; with less of it the core's own detail, which the denoiser would soften, weighs more.
MUCH_SEEN_THROUGH = 0.4
# Pixels; means of few keep noise, which in blocks looks like texture to the denoiser: with 2 it left twice as much.
FILL_BLOCK = 16


def check_denoiser() -> Any:
    """The denoiser's module; RuntimeError with the remedy where it is not installed."""
    try:
        import pyoidn
    except (ImportError, OSError) as error:
        raise RuntimeError(
            f"denoise: Open Image Denoise must be installed, got {error}. Run: pip install frazil[denoise]"
        ) from error
    return pyoidn


def denoise_film(film: Film) -> None:
    """Denoise a film's ray-traced layers in place.

    Parameters
    ----------
    film : Film
        With the layers ``albedo`` and ``N`` and all additive layers, as `render` gives it.

    Raises
    ------
    RuntimeError
        Where Open Image Denoise is not installed.
    """
    oidn = check_denoiser()
    additive = film.additive_layers()
    noisy = [name for name in additive if name not in NOISELESS and film[name].any()]
    alpha = film["beauty"][:, :, 3:]
    albedo, normal = film["albedo"], film["N"]
    guides = {"albedo": _guide(albedo, 0.0), "normal": _guide(normal, -1.0)}
    filled_guides = {
        "albedo": _guide(_extend(albedo, alpha), 0.0),
        "normal": _guide(_extend(normal * alpha, alpha), -1.0),
    }

    def clean(layer: np.ndarray, guides: dict[str, np.ndarray] = guides) -> np.ndarray:
        result = np.zeros_like(layer)
        for sign in (1.0, -1.0):
            part = np.maximum(sign * layer, 0.0)
            if part.any():
                result += sign * oidn.denoise(part, **guides, hdr=True, clean_aux=True, quality=QUALITY)
        return result

    def clean_filled(layer: np.ndarray) -> np.ndarray:
        if layer[alpha[:, :, 0] == 0.0].any():
            return clean(layer)
        return alpha * clean(_extend(layer, alpha), filled_guides)

    groups = {layer.removeprefix(name) for name in noisy for layer in additive[name]} or {""}
    for group in sorted(groups):
        parts = {name: film[name + group] for name in noisy if name + group in film.layers}
        core = film["translucency" + group]
        through = [parts[name] for name in SEEN_THROUGH if name in parts and parts[name].any()]
        noisy_sum = sum(through, np.zeros_like(core))
        whole = clean(core + noisy_sum) if through and core.any() else None
        for name, layer in parts.items():
            layer[:] = clean(layer) if name in SEEN_THROUGH else clean_filled(layer)
        if whole is not None:
            _share_out(whole - core, through, noisy_sum, core)
    for name in noisy:
        if additive[name]:
            film[name][:] = sum(film[layer] for layer in additive[name])
    film["beauty"][:, :, :3] = sum(film[name] for name in additive)


def _extend(layer: np.ndarray, covered: np.ndarray) -> np.ndarray:
    """The layer where it covers anything, as if it filled the pixel; elsewhere the mean of what is covered nearby."""
    own = layer / np.where(covered > 0.0, covered, 1.0)
    if covered.any() and not covered.all():
        (height, width), size = covered.shape[:2], FILL_BLOCK
        rows, columns = -(-height // size), -(-width // size)
        pad = ((0, rows * size - height), (0, columns * size - width), (0, 0))
        sums = [
            np.pad(image, pad).reshape(rows, size, columns, size, -1).sum(axis=(1, 3)) for image in (layer, covered)
        ]
        around = _extend(*sums).repeat(size, axis=0).repeat(size, axis=1)[:height, :width]
        own = np.where(covered > 0.0, own, around)
    return np.ascontiguousarray(own, dtype=np.float32)


def _share_out(seen_through: np.ndarray, parts: list[np.ndarray], noisy_sum: np.ndarray, core: np.ndarray) -> None:
    """Let the parts sum to `seen_through`, in place, as far as light goes through the pixel and not to the core."""
    own = sum(parts)
    brightness = np.maximum(_brightness(own), _brightness(noisy_sum))
    fraction = brightness / (brightness + _brightness(core) + 1e-12)
    rest = (seen_through - own) * np.minimum(1.0, fraction / MUCH_SEEN_THROUGH)
    shares = [_brightness(part) + 1e-12 for part in parts]
    total = sum(shares)
    for part, share in zip(parts, shares, strict=True):
        part += rest * (share / total)


def _brightness(layer: np.ndarray) -> np.ndarray:
    return np.abs(layer).sum(axis=2, keepdims=True)


def _guide(layer: np.ndarray, low: float) -> np.ndarray:
    return np.ascontiguousarray(np.clip(layer, low, 1.0), dtype=np.float32)
