#!/bin/sh
# Installs from Debian what checks targets and is missing, where that may be done; else says the command.
set -eu
missing=""
want() { command -v "$1" >/dev/null 2>&1 || missing="$missing $2"; }
want octave-cli octave
want mkoctfile octave-dev
want node nodejs
want chromium chromium
want arm-none-eabi-gcc "gcc-arm-none-eabi libnewlib-arm-none-eabi"
want qemu-system-arm qemu-system-arm
want wasm-ld "clang lld wasi-libc libclang-rt-14-dev-wasm32"
[ -n "$missing" ] || exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    # shellcheck disable=SC2086
    apt-get install -y --no-install-recommends $missing
else
    echo "missing, so their targets fail: apt install$missing" >&2
fi
