#!/usr/bin/env bash
# Installs what a build needs and this machine lacks, where apt-get and the rights to use it are at hand.
#
# scripts/setup.sh          for `make demo`: make, a C compiler (zstd comes as source) and Rust
# scripts/setup.sh web      for `make web`: the same, and Rust's compiler for browsers
# scripts/setup.sh test     for `make test`: all that, a C++ compiler (for another FLIP to compare with), git, rustfmt and
#                           clippy; and what draws without a graphics card
#                           (Mesa's Vulkan driver) and shows pages (Chromium, Node.js, npm), whose tests are skipped
#                           where they cannot be had
#
# Rust comes from the system's rustup package where there is one; otherwise the message says how to get it.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

has() { command -v "$1" >/dev/null 2>&1; }
stop() { printf 'setup: %s\n' "$@" >&2; exit 1; }

# --- packages ---------------------------------------------------------------------------------------------------

missing=()
has cc && has make && { [ "${1:-}" != test ] || has c++; } || missing+=(build-essential)
if [ "${1:-}" = test ]; then has git || missing+=(git); fi
# Only rustup's installer needs it.
if ! has cargo; then has curl || missing+=(curl ca-certificates); fi

as_root=()
may_install=false
if has apt-get; then
    if [ "$(id -u)" -eq 0 ]; then
        may_install=true
    elif has sudo && sudo -n true 2>/dev/null; then
        as_root=(sudo -n)
        may_install=true
    fi
fi

updated=false
install() {
    echo "setup: installing $*"
    if [ $updated = false ]; then
        "${as_root[@]}" apt-get update -qq </dev/null || return
        updated=true
    fi
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" </dev/null
}

if [ ${#missing[@]} -gt 0 ]; then
    has apt-get || stop "missing: ${missing[*]} (Debian's names), and there is no apt-get here." \
        "Install a C and a C++ compiler, make, git and curl by your system's means, then run this again."
    $may_install || stop "missing: ${missing[*]}, and there are no rights to install them. Run:" \
        "    sudo apt-get install ${missing[*]}"
    install "${missing[@]}"
fi

# Tests say what they skip where these are missing.
if [ "${1:-}" = test ] && $may_install; then
    optional=()
    has chromium || has chromium-browser || has google-chrome || optional+=(chromium)
    has node || optional+=(nodejs)
    has npm || optional+=(npm)
    compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' >/dev/null || optional+=(mesa-vulkan-drivers)
    compgen -G '/usr/lib/*/libvulkan.so.1' >/dev/null || optional+=(libvulkan1)
    if [ ${#optional[@]} -gt 0 ]; then
        install "${optional[@]}" || echo "setup: ${optional[*]} could not be installed: tests that need them are skipped" >&2
    fi
fi

# --- Rust -------------------------------------------------------------------------------------------------------

wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
how="Get it from https://rustup.rs:
    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y
then open a new shell, or run: . \"\$HOME/.cargo/env\""

# Where the system packages rustup, that is how Rust comes; otherwise the message says how.
if ! has cargo && has apt-get && apt-cache show rustup >/dev/null 2>&1 && [ "$(id -u)" -eq 0 ]; then
    echo "setup: installing rustup and the stable toolchain"
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends rustup </dev/null
    rustup default stable
fi

has cargo && has rustc || stop "Rust $wanted or newer is needed, and there is none on the PATH." "$how"

found=$(rustc --version 2>/dev/null | cut -d' ' -f2) || stop "rustc does not run: with rustup, choose a toolchain: rustup default stable"
oldest=$(printf '%s\n' "$wanted" "${found%%-*}" | sort -V | head -n 1)
if [ "$oldest" != "$wanted" ]; then
    if has rustup; then how="Run: rustup update stable"; fi
    stop "Rust $wanted or newer is needed; this is $found." "$how"
fi

if [ "${1:-}" = test ]; then
    for component in fmt:rustfmt clippy:clippy; do
        if ! cargo "${component%%:*}" --version >/dev/null 2>&1; then
            has rustup || stop "cargo ${component%%:*} is missing: install ${component##*:} with your Rust."
            rustup component add "${component##*:}"
        fi
    done
fi

# --- browsers ---------------------------------------------------------------------------------------------------

if [ "${1:-}" = web ] || [ "${1:-}" = test ]; then
    target=wasm32-unknown-unknown
    if ! [ -d "$(rustc --print target-libdir --target $target)" ]; then
        if ! { has rustup && rustup target add $target; }; then
            if [ "$1" = web ]; then
                stop "Rust cannot compile for browsers here: install its standard library for $target."
            fi
            echo "setup: Rust cannot compile for browsers here: the page is not built, and its tests are skipped" >&2
        fi
    fi
fi
