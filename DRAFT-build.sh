#!/bin/sh
# Build a ccx that loads external materials, from the distribution's own source package.
#
#     sh build.sh          into bubblefit's cache folder; prints where. About a minute.
#
# Debian's ccx comes without external material support (it has no dlopen). Nothing of the system's
# is replaced: compilers and libraries are installed by apt, the program itself goes to the cache,
# and the package lists this needs are kept apart from apt's own.
set -eu

cache=${BUBBLEFIT_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/bubblefit}
target=$cache/calculix/ccx
packages="gcc gfortran make dpkg-dev libspooles-dev libarpack2-dev liblapack-dev libblas-dev libc6-dev"

say() { echo "bubblefit calculix: $*" >&2; }
give_up() { say "$*"; exit 1; }

if [ -x "$target" ] && "$target" -v >/dev/null 2>&1; then
    say "already there: $target"
    exit 0
fi
command -v apt-get >/dev/null 2>&1 && command -v dpkg >/dev/null 2>&1 || give_up \
    "this needs Debian or a relative of it (apt-get); elsewhere compile ccx with" \
    "-DCALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT, link it with -ldl -rdynamic, and set BUBBLEFIT_CCX"

root=""
if [ "$(id -u)" != 0 ]; then
    root="sudo -n"
    sudo -n true >/dev/null 2>&1 || root=none
fi
mkdir -p "$cache/calculix" || give_up "cannot make $cache/calculix; set BUBBLEFIT_CACHE to a folder that can be written"
work=$(mktemp -d "$cache/calculix/build.XXXXXX") || give_up "cannot write in $cache/calculix"
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM HUP

# The distribution's own entries, with sources; others would not have calculix.
. /etc/os-release
mkdir -p "$work/parts" "$work/lists/partial" "$work/archives/partial"
[ -f /etc/apt/sources.list ] && awk -v suite="${VERSION_CODENAME:-}" '
    $1 == "deb" { for (i = 2; i <= NF; i++) if (index($i, suite) == 1) {
        print; sub(/^deb/, "deb-src"); print; break } }' /etc/apt/sources.list >"$work/sources.list"
[ -f "$work/sources.list" ] || : >"$work/sources.list"
for file in /etc/apt/sources.list.d/*.sources; do
    [ -f "$file" ] || continue
    if grep -Eq "^Suites:.*[[:space:]]${VERSION_CODENAME:-}" "$file"; then
        sed 's/^Types:.*/Types: deb deb-src/' "$file" >"$work/parts/$(basename "$file")"
    fi
done
apart="-o Dir::Etc::sourcelist=$work/sources.list -o Dir::Etc::sourceparts=$work/parts
    -o Dir::State::lists=$work/lists -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache=
    -o APT::Sandbox::User=root -o Acquire::Retries=3"

missing=""
for package in $packages; do
    dpkg -s "$package" >/dev/null 2>&1 || missing="$missing $package"
done
if [ -n "$missing" ] && [ "$root" = none ]; then
    give_up "as root: apt-get install$missing; then run this again"
fi
say "reading package lists"
# shellcheck disable=SC2086
apt-get $apart update -qq >&2 || give_up "apt-get update failed: is the package registry reached?"
if [ -n "$missing" ]; then
    say "installing$missing"
    # shellcheck disable=SC2086
    $root env DEBIAN_FRONTEND=noninteractive apt-get $apart install -y -qq \
        --no-install-recommends $missing </dev/null >"$work/install.log" 2>&1 || {
        tail -n 20 "$work/install.log" >&2
        give_up "installing$missing failed; install them by hand and run this again"
    }
fi
say "fetching the source of calculix-ccx"
# shellcheck disable=SC2086
(cd "$work" && apt-get $apart source -qq --only-source calculix-ccx) >"$work/source.log" 2>&1 || {
    tail -n 20 "$work/source.log" >&2
    give_up "no source package calculix-ccx"
}
source=$(find "$work" -type d -path "*/ccx_*/src" | head -n 1)
[ -n "$source" ] || give_up "the source package calculix-ccx holds no ccx_*/src"
cd "$source"
# Older gfortran does not know the flag that newer ones need for ccx's calls.
allow=""
echo "      end" >probe.f
gfortran -fallow-argument-mismatch -c probe.f -o probe.o 2>/dev/null && allow=-fallow-argument-mismatch
spooles=/usr/include/spooles
say "compiling ($(nproc) jobs)"
make -j"$(nproc)" CC=cc FC=gfortran \
    CFLAGS="-O2 -w -fopenmp -I$spooles -DARCH=Linux -DSPOOLES -DARPACK -DMATRIXSTORAGE -DUSE_MT=1 -DCALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT" \
    FFLAGS="-O2 -w -fopenmp $allow" \
    LIBS="-lspooles -lpthread -larpack -llapack -lblas -lm -lc -ldl -rdynamic" \
    >"$work/make.log" 2>&1 || { tail -n 25 "$work/make.log" >&2; give_up "compiling failed"; }
program=$(find . -maxdepth 1 -name "ccx_*" -type f -perm -u+x | head -n 1)
[ -n "$program" ] && "$program" -v >/dev/null 2>&1 || { tail -n 25 "$work/make.log" >&2; give_up "the program does not start"; }
strip "$program"
mv -f "$program" "$target"
say "ready: $target"
