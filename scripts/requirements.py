"""Print the Python requirements of this project that pyproject.toml lists, one a line.

Usage: requirements.py GROUP...    build, runtime, or a name of [project.optional-dependencies].

It runs before anything is installed, on Python 3.10 too, which has no tomllib: there it falls back on pip's own copy.
"""

import sys
from pathlib import Path

try:
    import tomllib
except ModuleNotFoundError:
    from pip._vendor import tomli as tomllib

# scikit-build-core runs these from the environment; a pip that isolates builds would fetch them by itself.
BUILD_TOOLS = ["cmake>=3.22", "ninja>=1.10"]


def requirements(group: str) -> list[str]:
    """The requirement lines of one group; KeyError with the known names for any other."""
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())
    groups = {
        "build": project["build-system"]["requires"] + BUILD_TOOLS,
        "runtime": project["project"]["dependencies"],
        **project["project"]["optional-dependencies"],
    }
    if group not in groups:
        raise KeyError(f"requirements: group must be one of {', '.join(groups)}, got {group!r}.")
    return groups[group]


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print("\n".join(requirements(name)))
