# Shared set-up of scripts/run, scripts/test and scripts/docs; to be sourced from the root of the checkout:
#
#     . scripts/_setup.sh EXTRA PACKAGE...
#
# Puts the project's environment, .venv, first on PATH: Face Poser with its dependencies from PyPI and the optional
# dependencies EXTRA of pyproject.toml ("" for none). The Debian packages PACKAGE... are installed if permissions allow,
# otherwise unpacked into .cache/system. This happens once; a stamp file records it until pyproject.toml or these scripts
# change, or the checkout moves.

setup_extra=$1
shift
cd -P .
setup_stamp=.venv/.ready${setup_extra:+-$setup_extra}
setup_key="$(cat pyproject.toml scripts/_setup.sh scripts/_system.sh | cksum) $PWD"

setup_say() { echo "Face Poser: $*" >&2; }

# Prints the first suitable Python. imgui-bundle publishes builds for 3.11 to 3.13.
setup_find_python() {
    local candidate
    for candidate in ${FACEPOSER_PYTHON:-python3 python3.13 python3.12 python3.11}; do
        if [ -n "${FACEPOSER_PYTHON:-}" ] ||
            "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; then
            "$candidate" -c 'import sys; print(sys.executable)' && return
        fi
    done
    setup_say "Python 3.11, 3.12 or 3.13 is needed, and this machine has" \
        "$(python3 -c 'import platform; print(platform.python_version())' 2>/dev/null || echo none);" \
        "install one of them, or set FACEPOSER_PYTHON to the path of one."
    return 1
}

setup_environment() {
    local python packages status=0
    python=$(setup_find_python) || return
    . scripts/_system.sh
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        system_packages "$@" &
        packages=$!
        setup_libraries "$python" || status=$?
        wait "$packages"
    else
        system_packages "$@" python3-venv
        setup_libraries "$python" || status=$?
    fi
    [ "$status" = 0 ] || return "$status"
    echo "$setup_key" >.venv/.ready
    echo "$setup_key" >"$setup_stamp"
}

setup_libraries() {
    local python=$1 pip_wheel options=(--quiet --disable-pip-version-check)
    setup_say "setting up the Python environment in .venv (once; this downloads up to 200 MB)"
    # Its programs contain the path of the environment, which must therefore be recreated if the checkout has moved.
    if ! { grep -qF "$PWD/.venv" .venv/bin/activate && .venv/bin/python -m pip --version; } >/dev/null 2>&1; then
        if "$python" -c 'import ensurepip' 2>/dev/null; then
            "$python" -m venv --clear .venv || return
        else
            pip_wheel=$(find "$PWD/.cache/system" -name 'pip-*.whl' 2>/dev/null | head -n 1)
            if [ -z "$pip_wheel" ]; then
                setup_say "this Python cannot create a virtual environment; install the package python3-venv."
                return 1
            fi
            "$python" -m venv --clear --without-pip .venv || return
            .venv/bin/python "$pip_wheel/pip" install --quiet pip || return
        fi
    fi
    # Who develops uses few modules of many libraries; Python compiles them when they are first imported.
    if [ "$setup_extra" = dev ]; then
        options+=(--no-compile)
    fi
    .venv/bin/python -m pip install "${options[@]}" --editable ".${setup_extra:+[$setup_extra]}" || {
        setup_say "the libraries could not be installed; see the messages above, and start again after fixing the cause."
        return 1
    }
}

setup_is_ready() { [ "$(cat "$setup_stamp" 2>/dev/null)" = "$setup_key" ] && [ -x .venv/bin/python ]; }

if ! setup_is_ready; then
    mkdir -p .cache
    exec 9>.cache/setup.lock
    # If two scripts start at once, the second waits for the first.
    if command -v flock >/dev/null; then flock 9; fi
    unset PYTHONHOME PYTHONPATH PIP_TARGET PIP_USER
    setup_is_ready || setup_environment "$@" || exit 1
    exec 9>&-
fi
if [ -r .cache/system/environment.sh ]; then
    . .cache/system/environment.sh
fi
export PATH="$PWD/.venv/bin:$PATH"
