#!/bin/sh
# Installs the system packages that are missing: setup.sh [PACKAGE …] beside the ones that every build needs.
# As root or with passwordless sudo it installs them; else it prints the one line to run and fails.
set -eu

missing=
need() { # need PACKAGE COMMAND…: the package is missing unless the command succeeds
    package=$1
    shift
    "$@" >/dev/null 2>&1 || missing="$missing $package"
}
need gcc sh -c 'command -v "${CC:-cc}"'
need pkg-config sh -c 'command -v pkg-config'
need libexpat1-dev pkg-config --exists expat
need zlib1g-dev pkg-config --exists zlib
need libopenexr-dev pkg-config --exists OpenEXR
need libpng-dev pkg-config --exists libpng
need libstb-dev test -f /usr/include/stb/stb_image.h
need python3-venv python3 -c 'import ensurepip, venv'
optional=
for package in "$@"; do
    case $package in
    # Mitsuba's fast variant wants LLVM 19; without it, its scalar variant serves.
    libllvm*) ls /usr/lib/*/libLLVM*19* >/dev/null 2>&1 || optional="$optional $package" ;;
    # A later clang warns of more; where there is none, tests take what there is.
    clang-*) command -v "$package" >/dev/null 2>&1 || optional="$optional $package" ;;
    # oneray as WebAssembly, for the lecture's page; where there is none, its tests say so.
    lld-*) command -v "wasm-$(echo "$package" | sed 's/^l//')" >/dev/null 2>&1 || optional="$optional $package" ;;
    wasi-libc) test -d /usr/include/wasm32-wasi || optional="$optional $package" ;;
    libclang-rt-*-wasm32) ls /usr/lib/llvm-*/lib/clang/*/lib/wasi >/dev/null 2>&1 || optional="$optional $package" ;;
    bubblewrap) need "$package" sh -c "command -v bwrap" ;;
    g++) need "$package" sh -c "command -v c++" ;;
    # Ubuntu has Chromium as a snap only; there Playwright installs its own.
    chromium) grep -q '^ID=ubuntu' /etc/os-release 2>/dev/null || need chromium sh -c 'command -v chromium' ;;
    # libFuzzer and the sanitizers of clang.
    libclang-rt-dev) need "$package" sh -c \
        'echo "int LLVMFuzzerTestOneInput(void) { return 0; }" | clang -fsanitize=fuzzer,address -x c - -o /dev/null' ;;
    *) need "$package" sh -c "command -v $package" ;;
    esac
done
[ -z "$missing$optional" ] && exit 0

install="apt-get install -y --no-install-recommends"
run="apt-get update -qq${missing:+ && $install$missing}${optional:+ && for p in$optional; do $install \$p || true; done}"
if ! command -v apt-get >/dev/null 2>&1; then
    echo "Please install (by their Debian names):$missing" >&2
    exit 1
elif [ "$(id -u)" = 0 ]; then
    DEBIAN_FRONTEND=noninteractive sh -c "$run" >&2
elif sudo -n true 2>/dev/null; then
    sudo -n DEBIAN_FRONTEND=noninteractive sh -c "$run" >&2
else
    echo "Some system packages are missing. Please run:" >&2
    echo "    sudo sh -c '$run'" >&2
    exit 1
fi
