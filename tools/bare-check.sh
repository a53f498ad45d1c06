#!/bin/bash
# Shows that `make TARGET` works on a bare machine: a fresh clone in a clean Debian 12 that has make, git and a Rust
# toolchain (read-only) and nothing else. Needs root, debootstrap and a network.
#
#   tools/bare-check.sh [TARGET] [FOLDER]     default: demo, a new folder under /tmp
#
# FOLDER is kept, so that a second run starts faster and the results can be looked at.
set -euo pipefail
cd "$(dirname "$0")/.."
. tools/env.sh

target=${1:-demo}
folder=${2:-$(mktemp -d /tmp/grassfire-bare.XXXXXX)}
suite=bookworm
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}

fail() { echo "bare-check: $*" >&2; exit 2; }
[ "$(id -u)" -eq 0 ] || fail "needs root (chroot)"
command -v debootstrap >/dev/null 2>&1 || fail "needs debootstrap: apt-get install debootstrap"

mkdir -p "$folder"
folder=$(realpath "$folder")
root=$folder/root
if [ ! -x "$root/usr/bin/make" ]; then
  echo "bare-check: Debian $suite into $root"
  debootstrap --variant=minbase --include=make,git,ca-certificates "$suite" "$root" "$mirror" >"$folder/debootstrap.log" \
    || fail "debootstrap failed, see $folder/debootstrap.log"
fi

# How this machine reaches the network: name servers, certificates, the package manager's and cargo's settings.
cp -L /etc/resolv.conf /etc/hosts "$root/etc/" 2>/dev/null || true
mkdir -p "$root/usr/local/share/ca-certificates" "$root/etc/apt/apt.conf.d"
cp /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
for file in /etc/apt/apt.conf.d/*proxy*; do [ -f "$file" ] && cp "$file" "$root/etc/apt/apt.conf.d/"; done
mkdir -p "$root/root/.cargo"
for file in "${CARGO_HOME:-$HOME/.cargo}"/config.toml; do [ -f "$file" ] && cp "$file" "$root/root/.cargo/"; done

if [ -f /etc/pip.conf ]; then cp /etc/pip.conf "$root/etc/"; fi

mounted=()
cleanup() { for place in "${mounted[@]}"; do umount "$place" || true; done; }
trap cleanup EXIT
bind() {
  mkdir -p "$root$2"
  if mount --bind "$1" "$root$2" 2>/dev/null; then mounted+=("$root$2"); mount -o "remount,bind,${3:-rw}" "$root$2" || true
  else return 1; fi
}
bind /proc /proc || true
bind /dev /dev || true
toolchain=$(rustc --print sysroot)
bind "$toolchain" /opt/rust ro || { rm -rf "$root/opt/rust"; cp -a "$toolchain" "$root/opt/rust"; }

rm -rf "$root/root/grassfire"
git clone --quiet --no-local . "$root/root/grassfire"

pass=()
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY; do
  [ -n "${!name:-}" ] && pass+=("$name=${!name}")
done
echo "bare-check: make $target in a fresh clone of $(git rev-parse --short HEAD)"
begin=$SECONDS
code=0
chroot "$root" /usr/bin/env -i HOME=/root PATH=/opt/rust/bin:/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 "${pass[@]}" \
  make -C /root/grassfire "$target" || code=$?
echo "bare-check: make $target ended with $code after $((SECONDS - begin)) s; look in $root/root/grassfire"
exit "$code"
