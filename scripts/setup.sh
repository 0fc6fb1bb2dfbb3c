#!/usr/bin/env bash
# Bring a bare Debian 12 or Ubuntu 22.04 / 24.04 to where Frazil builds: its Debian packages and the virtual environment.
# Usage: scripts/setup.sh packages            install the Debian packages that are missing, and only those
#        scripts/setup.sh venv DIR            make a virtual environment with a python3 >= 3.10 that has venv
#        scripts/setup.sh python DIR GROUP..  install requirement groups of pyproject.toml (build, runtime, test, ...)
# apt-get is not touched where nothing is missing. Needs root or sudo only where something is.
set -euo pipefail
cd "$(dirname "$0")/.."

# Why each is needed: docs/architecture.md.
readonly PACKAGES=(build-essential pkg-config libembree-dev libtbb-dev libhwy-dev libimath-dev doctest-dev openexr)

fail() {
    echo "setup: error: $*" >&2
    exit 1
}

is_installed() {
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# One apt-get command, noninteractive, as root; a second try after fresh package lists, for mirrors come and go.
apt() {
    local run=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail "packages must be installed as root: $*. Run as root, or install sudo."
        run=(sudo)
    fi
    run+=(env DEBIAN_FRONTEND=noninteractive apt-get -y -q -o Dpkg::Use-Pty=0 -o Acquire::Retries=3)
    "${run[@]}" update || true
    "${run[@]}" install --no-install-recommends "$@" && return
    sleep 5
    "${run[@]}" update
    "${run[@]}" install --no-install-recommends "$@"
}

# Is this a python3 >= 3.10 that can make virtual environments and build extension modules?
is_usable_python() {
    "$1" - 2>/dev/null <<'PY'
import ensurepip, os, sys, sysconfig, venv
sys.exit(not (sys.version_info >= (3, 10) and os.path.exists(sysconfig.get_path("include") + "/Python.h")))
PY
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-} python3 /usr/bin/python3 python3.13 python3.12 python3.11 python3.10; do
        if command -v "$candidate" >/dev/null && is_usable_python "$candidate"; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

install_packages() {
    local package missing=()
    command -v dpkg-query >/dev/null || fail "this machine has no dpkg. Install what docs/architecture.md lists by hand."
    for package in "${PACKAGES[@]}"; do
        is_installed "$package" || missing+=("$package")
    done
    find_python >/dev/null || missing+=(python3 python3-venv python3-dev)
    [ ${#missing[@]} -eq 0 ] && return
    echo "setup: installing ${missing[*]}"
    apt "${missing[@]}" || fail "apt-get could not install: ${missing[*]}. See its lines above."
}

make_venv() {
    local venv=$1 python
    if ! "$venv/bin/python" -c pass 2>/dev/null; then
        python=$(find_python) || fail "python3 must be >= 3.10 with venv and headers. Set PYTHON to one."
        echo "setup: $venv with $python"
        "$python" -m venv --clear "$venv"
    fi
    # What venv brings is as old as the system: 22.0 on Ubuntu 22.04, which has no --config-settings.
    "$venv/bin/python" -m pip install -q --disable-pip-version-check --retries 5 "pip>=23.1"
}

install_python() {
    local venv=$1
    shift
    "$venv/bin/python" scripts/requirements.py "$@" >"$venv/requirements.txt"
    "$venv/bin/pip" install -q --disable-pip-version-check --retries 5 -r "$venv/requirements.txt"
}

command=${1:-}
[ $# -gt 0 ] && shift
case "$command" in
    packages) install_packages ;;
    venv) make_venv "$@" ;;
    python) install_python "$@" ;;
    *) fail "usage: scripts/setup.sh packages | venv DIR | python DIR GROUP..." ;;
esac
