#!/usr/bin/env bash
# Make a wheel that carries Embree, TBB, Imath and Highway with it, so that it runs where none of them is installed.
# Usage: scripts/make_wheel.sh BUILD_DIR WHEEL_DIR     (inside the virtual environment of make)
# The wheel is as new as the C library of the machine that makes it: manylinux_2_36 on Debian 12.
set -euo pipefail
cd "$(dirname "$0")/.."
build=$1
dist=$2

scripts/setup.sh python "$(python -c 'import sys; print(sys.prefix)')" wheel
plain=$(mktemp -d)
trap 'rm -rf "$plain"' EXIT
pip wheel -q --disable-pip-version-check --no-build-isolation --no-deps -Cbuild-dir="$build" \
    -Ccmake.define.FRAZIL_BUILD_TESTS=ON -w "$plain" .
rm -rf "$dist" && mkdir -p "$dist"
auditwheel repair --wheel-dir "$dist" "$plain"/frazil-*.whl
python scripts/add_licenses.py "$dist"/frazil-*.whl
ls -l "$dist"
