"""Writes a field of ice: hundreds of instances of a few formations on snow.

    python examples/ice_field.py -o out/ice_field.usdc [--count 500] [--spacing 0.02]
    frazil render out/ice_field.usdc -o out/ice_field.exr --bake-samples 8

`--spacing` sets how many points the field has in effect; `frazil render --stats` counts them and the memory.
"""

import argparse
import sys
from pathlib import Path

from frazil.formations.field import ice_field, write_field


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/ice_field.usdc"), help="usd, usda or usdc")
    parser.add_argument("--count", type=int, default=500, help="instances")
    parser.add_argument("--prototypes", type=int, default=5, help="different formations")
    parser.add_argument("--triangles", type=int, default=60_000, help="of each prototype")
    parser.add_argument("--spacing", type=float, default=0.0, help="of points, in metres; 0 = from the material")
    parser.add_argument("--seed", type=int, default=0, help="another number, another field")
    options = parser.parse_args(arguments)
    try:
        field = ice_field(options.count, options.prototypes, options.seed, options.triangles, options.spacing)
        options.output.parent.mkdir(parents=True, exist_ok=True)
        write_field(field, options.output)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{options.output}: {options.count} instances of {options.prototypes} formations")
    return 0


if __name__ == "__main__":
    sys.exit(main())
