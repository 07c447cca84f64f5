# System packages for scripts/_setup.sh; to be sourced. Defines system_packages PACKAGE...

# Installs missing Debian packages: into the system as root or with passwordless sudo, otherwise unpacked into
# .cache/system. On other systems it does nothing; the program reports missing libraries.
system_packages() {
    local missing=() package as_root=()
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null || return 0
    for package in "$@"; do
        system_has "$package" || missing+=("$package")
    done
    [ ${#missing[@]} -gt 0 ] || return 0

    if [ "$(id -u)" != 0 ]; then
        as_root=(sudo -n)
    fi
    if [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; then
        setup_say "installing the system packages ${missing[*]}"
        {
            "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 update &&
                "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o DPkg::Lock::Timeout=300 \
                    install --no-install-recommends "${missing[@]}"
        } >.cache/system.log 2>&1 && return
    else
        setup_say "unpacking the system packages ${missing[*]} into .cache/system, since installing them requires root"
        system_unpack "${missing[@]}" >.cache/system.log 2>&1 && return
    fi
    tail -n 3 .cache/system.log >&2
    setup_say "these packages could not be installed, so later steps may fail: ${missing[*]}"
}

system_has() { dpkg-query -W -f '${db:Status-Status}\n' "$1" 2>/dev/null | grep -qx installed; }

# Downloads the packages and their missing dependencies, with APT's state in .cache/apt; unpacks them into .cache/system,
# and writes a file with the environment variables that programs need to find them.
system_unpack() {
    local apt=$PWD/.cache/apt root=$PWD/.cache/system deb
    local options=(-qq -o Debug::NoLocking=true -o "Dir::State::Lists=$apt/lists" -o "Dir::Cache=$apt"
        -o "Dir::Cache::Archives=$apt/archives" -o APT::Sandbox::User=)
    mkdir -p "$apt/lists/partial" "$apt/archives/partial"
    apt-get "${options[@]}" update || return
    # pip is in its own package, a dependency of python3-venv, the rest of which works only when installed.
    apt-get "${options[@]}" -y --no-install-recommends --download-only install "${@/python3-venv/python3-pip-whl}" || return
    rm -rf "$root"
    mkdir -p "$root"
    for deb in "$apt"/archives/*.deb; do
        # An upgrade of an installed library, the C library in particular, must not be mixed with the installed version.
        system_has "$(dpkg-deb -f "$deb" Package)" || dpkg-deb -x "$deb" "$root" || return
    done
    rm -rf "$apt"
    system_relocate "$root"
}

# Relocates the programs and libraries unpacked in ROOT, and writes ROOT/environment.sh.
system_relocate() {
    local root=$1 libraries
    libraries=$(find "$root/usr/lib" -maxdepth 1 -type d -name '*-linux-gnu*' | head -n 1)
    mkdir -p "$root/bin" "$root/python"
    if [ -x "$root/usr/bin/Xvfb" ]; then
        # Xvfb calls /usr/bin/xkbcomp and opens drivers below /usr/lib. With these paths shortened, it searches the former
        # on PATH, and the latter in its working directory.
        python3 - "$root/usr/bin/Xvfb" "/usr/lib/${libraries##*/}/dri" <<'PYTHON' || return
import sys
from pathlib import Path

server = Path(sys.argv[1])
code = server.read_bytes()
for name, relocated in ((b"/usr/bin", b""), (sys.argv[2].encode(), b"dri")):
    code = code.replace(b"\0" + name + b"\0", b"\0" + relocated.ljust(len(name), b"\0") + b"\0")
server.write_bytes(code)
PYTHON
        cat >"$root/bin/Xvfb" <<SHELL
#!/bin/sh
mkdir -m 1777 /tmp/.X11-unix 2>/dev/null
PATH="\$PATH:$root/usr/bin"
cd "$libraries" && exec "$root/usr/bin/Xvfb" -xkbdir "$root/usr/share/X11/xkb" "\$@"
SHELL
        chmod +x "$root/bin/Xvfb"
    fi
    cat >"$root/python/sitecustomize.py" <<'PYTHON'
"""Let ctypes find libraries on LD_LIBRARY_PATH without a linker."""

import ctypes.util
import os
from pathlib import Path

_installed = ctypes.util.find_library


def _find_library(name):
    for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":"):
        for path in sorted(Path(folder or "/nowhere").glob(f"lib{name}.so.*")):
            return path.name
    return _installed(name)


ctypes.util.find_library = _find_library
PYTHON
    {
        echo "export PATH=\"$root/bin:\$PATH:$root/usr/bin\""
        echo "export LD_LIBRARY_PATH=\"\${LD_LIBRARY_PATH:+\$LD_LIBRARY_PATH:}$libraries:$root/lib/${libraries##*/}\""
        echo "export PYTHONPATH=\"$root/python\""
        [ ! -d "$libraries/dri" ] || echo "export LIBGL_DRIVERS_PATH=\"$libraries/dri\""
        local vendors=share/glvnd/egl_vendor.d
        [ ! -d "$root/usr/$vendors" ] ||
            echo "export __EGL_VENDOR_LIBRARY_DIRS=\"/etc/glvnd/egl_vendor.d:/usr/$vendors:$root/usr/$vendors\""
    } >"$root/environment.sh"
}
