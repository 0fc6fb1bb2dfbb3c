"""Errors of every profile against random walks in a half space, and a picture of the curves.

Walks (tests/python/half_space_walk.py) are lit from all around, isotropic, in mean free paths. Profiles that hold all
orders of scattering are set against all the light that leaves, the others against light of more than one scattering.
`curve` is the largest error of F(R)/F(inf) over R; `F` that of F(R) itself, over the walk's total.

    python bench/profiles.py [--walks 200000] [--plot docs/images/profiles.png]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

import frazil as fz

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "python"))
from half_space_walk import Walks, walk  # noqa: E402

ALL_ORDERS = {"Dipole": fz.Dipole, "BetterDipole": fz.BetterDipole, "NormalizedDiffusion": fz.NormalizedDiffusion}
MULTIPLE = {"PhotonBeamDiffusion": fz.PhotonBeamDiffusion, "MultipleScattering": fz.MultipleScattering}
ALBEDOS = (0.5, 0.8, 0.9, 0.95, 0.99, 0.995, 0.999, 0.9999)


def within_walk(walks: Walks, name: str) -> np.ndarray:
    """What left within each edge, of the orders that the profile holds."""
    return walks.within("multiple") + (walks.within("single") if name in ALL_ORDERS else 0.0)


def errors(walks: Walks, name: str, medium: fz.Medium) -> tuple[float, float]:
    """Largest error of the curve alone and with the albedo."""
    profile = (ALL_ORDERS | MULTIPLE)[name](medium)
    true, mine = within_walk(walks, name), profile.within(walks.edges[1:])[:, 0]
    total = walks.multiple.sum() + (walks.single.sum() if name in ALL_ORDERS else 0.0)
    curve = np.abs(mine / profile.albedo[0] - true / total).max()
    return float(curve), float(np.abs(mine - true).max() / total)


def report(eta: float, count: int, plots) -> None:
    names = [*ALL_ORDERS, *MULTIPLE]
    print(f"eta = {eta}\n\n| alpha' | walk: once, more | " + " | ".join(f"{name}: curve, F" for name in names) + " |")
    print("|---" * (2 + len(names)) + "|")
    for alpha in ALBEDOS:
        walks = walk(alpha, eta, "diffuse", max(count // 10, int(count * min(1.0, 20 * (1 - alpha)))))
        medium = fz.Medium(alpha, 1.0 - alpha, eta=eta)
        cells = [f"{walks.single.sum():.3f}, {walks.multiple.sum():.3f}"]
        for name in names:
            curve, both = errors(walks, name, medium)
            cells.append(f"{curve:.3f}, {both:.3f}")
        print(f"| {alpha} | " + " | ".join(cells) + " |", flush=True)
        if plots is not None and alpha in plots:
            draw(plots[alpha], walks, alpha, eta, medium)


def draw(axes, walks: Walks, alpha: float, eta: float, medium: fz.Medium) -> None:
    """Light per step of ln r, so that equal areas are equal energies."""
    inner, outer = walks.edges[1:-1], walks.edges[2:]
    middle, width = np.sqrt(inner * outer), np.log(outer / inner)
    axes.plot(middle, (walks.multiple + walks.single)[1:-1] / width, ".", color="0.6", label="walk, all")
    axes.plot(middle, walks.multiple[1:-1] / width, ".", color="k", label="walk, more than once")
    for name, kind in (ALL_ORDERS | MULTIPLE).items():
        style = "--" if name in ALL_ORDERS else "-"
        energy = 2 * np.pi * middle**2 * kind(medium).reflectance(middle)[:, 0]
        axes.plot(middle, energy, style, label=name)
    axes.set(xscale="log", xlim=(1e-2, 100), xlabel="r (mean free paths)", title=f"alpha' = {alpha}, eta = {eta}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--walks", type=int, default=200_000)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    shown = (0.5, 0.95, 0.999)
    figure = None
    if options.plot:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(2, len(shown), figsize=(11, 6))
    for row, eta in enumerate((1.0, 1.31)):
        report(eta, options.walks, dict(zip(shown, axes[row], strict=True)) if figure else None)
    if figure:
        axes[0, 0].set_ylabel("2 pi r² Rd")
        axes[1, 0].set_ylabel("2 pi r² Rd")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="lower center", ncols=7, fontsize=8)
        figure.tight_layout(rect=(0, 0.04, 1, 1))
        figure.savefig(options.plot, dpi=80)


if __name__ == "__main__":
    main()
