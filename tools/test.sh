#!/bin/bash
# Everything that must hold before a change is merged.
set -euo pipefail
cd "$(dirname "$0")/.."
. tools/env.sh

target=${CARGO_TARGET_DIR:-target}
step() { echo; echo "== $* ($(date +%H:%M:%S))"; }

missing=()
cargo fmt --version >/dev/null 2>&1 || missing+=(rustfmt)
cargo clippy --version >/dev/null 2>&1 || missing+=(clippy)
if [ ${#missing[@]} -gt 0 ]; then rustup component add "${missing[@]}"; fi

step format
cargo fmt --all --check

# One profile, one target folder and the same set of crates for all steps: cargo then compiles dependencies once for
# checking and once for running.
step lints
cargo clippy --release --locked --workspace --all-targets -- -D warnings
step lints without the CAD kernel
cargo clippy --release --locked -p grassfire -p grassfire-cli --all-targets --no-default-features -- -D warnings

step documentation
RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps -p grassfire -p grassfire-cli --quiet

step unit tests without the CAD kernel
cargo test --release --locked -p grassfire -p grassfire-cli --no-default-features --lib --bins --quiet

# Builds the program too.
step build
cargo test --release --locked --workspace --no-run

step demo
demo=$(mktemp -d)
trap 'rm -rf "$demo"' EXIT
"$target/release/grassfire" demo wishbone -o "$demo/wishbone" -q || [ $? -eq 1 ]

step outside checks
tools/outside-check.sh "$demo/wishbone"

# Tests on real and on bad parts look for the corpus beside the repository or in GRASSFIRE_CORPUS, and say so when it
# is not there.
step tests
if cargo nextest --version >/dev/null 2>&1; then
  cargo nextest run --release --locked --workspace --no-fail-fast
else
  cargo test --release --locked --workspace --no-fail-fast
fi
step done
