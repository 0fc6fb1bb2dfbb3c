#!/usr/bin/env bash
# Show that the wheel is self-contained: install it in a fresh virtual environment and render, with the Debian libraries
# that it was built from hidden from the loader.
# Usage: scripts/check_wheel.sh WHEEL_DIR
# They are hidden by empty files mounted over them in a mount namespace (needs root); where that is not possible, the
# loader's own record must show that only the libraries inside the wheel were opened.
set -euo pipefail
cd "$(dirname "$0")/.."
wheel=$(ls "$1"/frazil-*.whl)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q --disable-pip-version-check "$wheel"
cp scripts/wheel_scene.usda "$folder/scene.usda"
: >"$folder/empty"

cat >"$folder/render.sh" <<'RENDER'
set -euo pipefail
cd "$1"
hidden=$2
if [ "$hidden" = hide ]; then
    for library in $(ldconfig -p | awk '$1 ~ /^lib(embree|tbb|Imath|hwy)/ { print $NF }' | xargs -r -n1 readlink -f | sort -u); do
        mount --bind empty "$library"
        echo "hidden: $library"
    done
fi
LD_DEBUG=files LD_DEBUG_OUTPUT=loader venv/bin/frazil render scene.usda -o out.exr --resolution 64x36 --samples 4
venv/bin/frazil info out.exr | head -3
RENDER

if [ "$(id -u)" -eq 0 ] && unshare --mount true 2>/dev/null; then
    unshare --mount bash "$folder/render.sh" "$folder" hide
else
    echo "check_wheel: libraries cannot be hidden here; reading the loader's record instead"
    bash "$folder/render.sh" "$folder" keep
fi

foreign=$(cat "$folder"/loader.* | grep -oE 'calling init: .*lib(embree|tbb|Imath|hwy)[^ ]*' | grep -v "$folder" || true)
own=$(cat "$folder"/loader.* | grep -oE 'calling init: .*lib(embree|tbb)[^ ]*' | grep -c "$folder" || true)
if [ -n "$foreign" ] || [ "$own" -eq 0 ]; then
    echo "check_wheel: error: libraries were loaded from outside the wheel: ${foreign:-none of its own found}" >&2
    exit 1
fi
echo "check_wheel: rendered with $own libraries, all of them from $(basename "$wheel")"
