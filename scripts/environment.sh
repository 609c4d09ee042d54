# shellcheck shell=sh
# Sourced by scripts/demo and scripts/test: makes .venv, once, and leaves its python in $python.
# It says in one line what the system lacks, and installs that when it runs as root on Debian or Ubuntu.
# Settings: PYTHON=python3.12 picks the interpreter; PIP_INDEX_URL and PIP_EXTRA_INDEX_URL are pip's own.

say() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; }

fail() {
    say "$*"
    exit 3
}

# install PACKAGE…: Debian packages, when that is possible; otherwise the line that says what to do.
install_packages() {
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
        say "installing missing system packages: $*"
        { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"; } \
            >/dev/null || fail "apt-get could not install: $*"
    else
        fail "missing system packages: $* (on Debian or Ubuntu: sudo apt-get install $*)"
    fi
}

is_new_enough() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 15))' >/dev/null 2>&1; }

find_python() {
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11 python3.14 python}; do
        if is_new_enough "$candidate"; then
            printf '%s\n' "$candidate"
            return 0
        fi
    done
    return 1
}

make_venv() {
    base=$(find_python) || {
        install_packages python3 python3-venv
        base=$(find_python) || fail "no Python 3.11 to 3.14 found: install one and name it, PYTHON=/path/to/python $0"
    }
    "$base" -c 'import ensurepip, venv' >/dev/null 2>&1 || install_packages python3-venv
    say "making .venv with $("$base" -V 2>&1)"
    "$base" -m venv --clear .venv || fail "$base could not make .venv: see the message above"
}

# The stamp holds what the installed packages depend on: unchanged, the second run installs nothing.
install_requirements() {
    wanted=$(cat pyproject.toml scripts/constraints.txt scripts/build_kernel.py runtime/kernel/*.?pp | cksum)
    if [ "$(cat .venv/installed 2>/dev/null)" != "$wanted" ]; then
        say "installing Python packages into .venv (several minutes the first time)"
        "$python" -m pip install --quiet --disable-pip-version-check -c scripts/constraints.txt -e ".[all,test,dev,docs]" ||
            fail "pip could not install the packages: see the message above"
        printf '%s\n' "$wanted" >.venv/installed
    fi
}

loads() { "$python" -c 'import ctypes, sys; ctypes.CDLL(sys.argv[1])' "$1" >/dev/null 2>&1; }

has_gl_driver() {
    for driver in /usr/lib/*/dri/*_dri.so /usr/lib*/dri/*_dri.so /usr/lib*/libgallium*.so /usr/lib/*/libgallium*.so \
        /usr/share/glvnd/egl_vendor.d/*nvidia*.json /etc/glvnd/egl_vendor.d/*.json; do
        if [ -e "$driver" ]; then return 0; fi
    done
    return 1
}

require_opengl() {
    if [ "$(uname -s)" != Linux ]; then return 0; fi
    absent=""
    loads libEGL.so.1 || absent="$absent libegl1"
    loads libGL.so.1 || absent="$absent libgl1"
    has_gl_driver || absent="$absent libgl1-mesa-dri"
    # shellcheck disable=SC2086  # one word a package
    if [ -n "$absent" ]; then install_packages $absent; fi
}

python=.venv/bin/python
is_new_enough "$python" || make_venv
install_requirements
require_opengl
