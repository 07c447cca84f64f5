# Shared set-up of scripts/run and scripts/test; to be sourced. Puts a ready Python environment first on PATH.
# Usage: . scripts/_setup.sh EXTRA SYSTEM_PACKAGE...

extra=$1
shift

missing=""
for package in "$@"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing="$missing $package"
done
if [ -n "$missing" ] && command -v apt-get >/dev/null; then
    as_root=""
    [ "$(id -u)" = 0 ] || as_root="sudo -n"
    if [ -z "$as_root" ] || sudo -n true 2>/dev/null; then
        echo "Installing system packages:$missing"
        export DEBIAN_FRONTEND=noninteractive
        { $as_root apt-get update -qq && $as_root apt-get install -y -qq --no-install-recommends $missing; } >/dev/null ||
            echo "Could not install$missing; going on without." >&2
    else
        echo "These system packages are missing and cannot be installed without root:$missing" >&2
    fi
fi

if [ -z "${FACEPOSER_PYTHON:-}" ]; then
    for candidate in python3 python3.13 python3.12 python3.11; do
        if command -v "$candidate" >/dev/null &&
            "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))'; then
            FACEPOSER_PYTHON=$candidate
            break
        fi
    done
fi
if [ -z "${FACEPOSER_PYTHON:-}" ]; then
    echo "Face Poser needs Python 3.11, 3.12 or 3.13; install one of them or name it in FACEPOSER_PYTHON." >&2
    exit 1
fi

stamp=.venv/.ready-$extra-$(cksum <pyproject.toml | cut -d' ' -f1)
if [ ! -e "$stamp" ]; then
    echo "Setting up the Python environment in .venv (once)"
    [ -x .venv/bin/pip ] || "$FACEPOSER_PYTHON" -m venv --clear .venv
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -e ".${extra:+[$extra]}"
    rm -f .venv/.ready-"$extra"-*
    touch "$stamp"
fi
PATH=$PWD/.venv/bin:$PATH
export PATH OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
