#!/usr/bin/env bash
# All checks, from a clean clone: fetches what is missing, then tests, format,
# lints and documentation. Ends at the first step that fails.
set -euo pipefail
cd "$(dirname "$0")/.."

export CARGO_TERM_COLOR=never
# Everything is built once: what only helps the next build, or a debugger, takes time.
export CARGO_INCREMENTAL=0 CARGO_PROFILE_DEV_DEBUG=0

step() {
    local name=$1 from=$SECONDS
    shift
    echo "== $name: $*"
    if "$@"; then
        echo "== $name: done in $((SECONDS - from)) s ($SECONDS s in all)"
    else
        local code=$?
        echo "== $name: FAILED with $code after $((SECONDS - from)) s"
        exit "$code"
    fi
}

as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo -n "$@"
    else
        echo "neither root nor sudo: cannot run $*" >&2
        return 1
    fi
}

# Debian packages by the program that is needed of them; nothing that is there
# is installed again.
packages() {
    local missing=()
    command -v cc >/dev/null || missing+=(gcc libc6-dev)
    command -v stty >/dev/null || missing+=(coreutils)
    # Without it the plug-ins are larger than they may be.
    command -v wasm-opt >/dev/null || missing+=(binaryen)
    command -v openssl >/dev/null || missing+=(openssl)
    command -v curl >/dev/null || missing+=(curl)
    command -v jq >/dev/null || missing+=(jq)
    command -v chromium >/dev/null || missing+=(chromium fonts-dejavu-core)
    command -v ser2net >/dev/null || missing+=(ser2net)
    command -v sx >/dev/null || missing+=(lrzsz)
    command -v kermit >/dev/null || missing+=(ckermit)
    command -v systemd-analyze >/dev/null || missing+=(systemd)
    command -v unshare >/dev/null || missing+=(util-linux)
    command -v tshark >/dev/null || missing+=(tshark)
    command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
    command -v qemu-system-arm >/dev/null || missing+=(qemu-system-arm)
    command -v strip >/dev/null || missing+=(binutils)
    command -v ip >/dev/null || missing+=(iproute2)
    command -v setpriv >/dev/null || missing+=(util-linux)
    command -v clang >/dev/null && command -v wasm-ld >/dev/null || missing+=(clang lld)
    command -v node >/dev/null && command -v npm >/dev/null || missing+=(nodejs npm)
    python3 -c 'import ensurepip' 2>/dev/null || missing+=(python3-venv)
    if [ ${#missing[@]} = 0 ]; then
        echo "nothing is missing"
        return
    fi
    as_root apt-get update || return
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y --no-install-recommends "${missing[@]}"
}

# Adds what the toolchain in use lacks. Without rustup, or without a network,
# what is there has to do: the steps below say what is missing.
toolchain() {
    local sysroot rustup
    sysroot=$(rustc --print sysroot) || return
    if ! rustup=$(command -v rustup); then
        echo "there is no rustup: taking $sysroot as it is"
        return
    fi
    local name=${RUSTUP_TOOLCHAIN:-}
    [ -n "$name" ] || name=$("$rustup" show active-toolchain | cut -d' ' -f1) || return
    if ! cargo fmt --version >/dev/null 2>&1 || ! cargo clippy --version >/dev/null 2>&1; then
        "$rustup" component add --toolchain "$name" rustfmt clippy ||
            echo "rustfmt and clippy could not be added to $name"
    fi
    local target
    for target in wasm32v1-none wasm32-unknown-unknown thumbv7em-none-eabihf; do
        if [ ! -d "$sysroot/lib/rustlib/$target/lib" ]; then
            "$rustup" target add --toolchain "$name" "$target" ||
                echo "$target could not be added to $name"
        fi
    done
}

# What other languages need, as it is pinned, below target/.
languages() {
    mkdir -p target/tools || return
    cp sdk/assemblyscript/package.json sdk/assemblyscript/package-lock.json target/tools/ || return
    (cd target/tools && npm ci --ignore-scripts --no-audit --no-fund) || return
    mkdir -p target/tools/page || return
    cp runner/service/tests/page/package.json runner/service/tests/page/package-lock.json \
        target/tools/page/ || return
    (cd target/tools/page && npm ci --ignore-scripts --no-audit --no-fund) || return
    python3 -m venv target/tools/venv || return
    target/tools/venv/bin/pip install --quiet --requirement docs/hosts/requirements.txt \
        --requirement runner/service/tests/api/requirements.txt || return
    ln -sf python3 target/tools/venv/bin/python_wasmtime
}

# Licences, sources and duplicates are a test of xtask's. cargo-deny, which knows advisories too, takes
# minutes to build: it is run where it is installed and can have its database.
advisories() {
    if ! cargo deny --version >/dev/null 2>&1; then
        echo "left out: advisories, because there is no cargo-deny (cargo install --locked cargo-deny)"
    elif ! cargo deny fetch >/dev/null 2>&1; then
        echo "left out: advisories, because their database cannot be had"
    else
        cargo deny --locked --all-features check
    fi
}

step "packages" packages
step "toolchain" toolchain
step "languages" languages
export PATH="$PWD/target/tools/node_modules/.bin:$PWD/target/tools/venv/bin:$PATH"
