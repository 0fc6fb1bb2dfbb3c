"""Plot profiles, a ramp, and the coverage at the tip of a cone: python examples/profiles.py [OUT.png]."""

from __future__ import annotations

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import frazil as fz


def main(path: str = "profiles.png") -> None:
    medium = fz.Medium(sigma_s_prime=100.0, sigma_a=(4.0, 1.0, 0.2), eta=1.31)
    r = np.geomspace(1e-4, 0.3, 300)
    figure, (profiles, ramps, tips) = plt.subplots(1, 3, figsize=(13, 4))
    for kind, style in ((fz.Dipole, "-"), (fz.BetterDipole, "--")):
        values = kind(medium).reflectance(r)
        for c, color in enumerate("rgb"):
            profiles.loglog(r, values[:, c], style, color=color, label=kind.__name__ if c == 0 else None)
    profiles.set(xlabel="r (m)", ylabel="Rd (1/m²)", title="Profiles")
    profiles.legend()

    ramp = fz.Ramp([0.0, 0.02, 0.1], [[1.0, 1.0, 1.0], [0.3, 0.9, 1.2], [0.1, 0.4, 1.5]])
    for c, color in enumerate("rgb"):
        ramps.plot(r, ramp.eval(r)[:, c], color=color)
    ramps.set(xlabel="r (m)", ylabel="factor", title="Ramp")

    profile = fz.Dipole(medium)
    angle = np.linspace(0.05, np.pi / 2, 60)
    coverage = np.sin(angle)[:, None] * profile.albedo
    for mode in ("off", "ratio", "linear"):
        gain = fz.area_compensation(coverage, profile, mode=mode, limit=100.0)
        tips.plot(np.degrees(angle), (coverage * gain / profile.albedo)[:, 1], label=mode)
    tips.set(xlabel="half angle of the tip (degrees)", ylabel="exitance over albedo", title="Tips, by compensation")
    tips.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main(*sys.argv[1:2])
