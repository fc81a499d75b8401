#!/bin/sh
# Installs into a scratch folder, uses what lies there as a stranger would, uninstalls. make check-install calls it with
# SCRATCH (the folder), EXPORTS (the version script of the shared library), BUILD and CONFIG.
set -u
. tests/tap.sh
scratch=$SCRATCH exports=$EXPORTS make=$MAKE
rm -rf "$scratch" && mkdir -p "$scratch/root" || exit 1
unset MAKEFLAGS MFLAGS
root="$scratch/root"

detail=$($make -s install DESTDIR="$root" PREFIX=/usr 2>&1)
result "make install"
detail=$(find "$root" | sed "s|$root||")
[ -x "$root/usr/bin/karst" ] && [ -e "$root/usr/lib/libkarst.a" ] && [ -e "$root/usr/lib/libkarst.so" ] &&
    [ -e "$root/usr/lib/pkgconfig/karst.pc" ] && [ -e "$root/usr/include/karst/karst.h" ]
result "command, libraries, headers and karst.pc are there"

# ---- the library's face ----
sed -n 's/^ *\(karst_[a-z0-9_]*\);$/\1/p' "$exports" | sort > "$scratch/declared"
nm -D --defined-only "$root/usr/lib/libkarst.so" | sed -n 's/.* T //p' | sed 's/@@.*//' | sort > "$scratch/exported"
detail=$(comm -13 "$scratch/declared" "$scratch/exported")
[ -s "$scratch/exported" ] && [ -z "$detail" ]
result "the shared library exports nothing but the public headers' names"
detail=$(comm -23 "$scratch/declared" "$scratch/exported")
[ -z "$detail" ]
result "it exports every one of them"
detail=$(readelf -d "$root/usr/lib/libkarst.so" | grep SONAME)
echo "$detail" | grep -q 'libkarst\.so\.[0-9]'
result "it has a soname"

# ---- a stranger's program ----
export PKG_CONFIG_PATH="$root/usr/lib/pkgconfig" PKG_CONFIG_SYSROOT_DIR="$root"
version=$("$root/usr/bin/karst" --version | sed -n '1s/^karst //p')
[ "$(pkg-config --modversion karst)" = "$version" ]
result "karst.pc and the command agree on the version"
mkdir "$scratch/stranger" && cp demos/minimal.c demos/mesh.c demos/minimal.mk "$scratch/stranger"
detail=$($make -s -C "$scratch/stranger" -f minimal.mk CFLAGS="-Wall -Wextra -Werror" 2>&1)
result "demos/minimal.c builds with its own Makefile against what is installed"
detail=$(LD_LIBRARY_PATH="$root/usr/lib" "$scratch/stranger/minimal" hills "$scratch/minimal.png" 2>&1)
[ $? -eq 0 ] && [ -s "$scratch/minimal.png" ]
result "and renders a picture"
# A ball of triangles that Karst itself gives out.
echo 'float density(vec3 p) { return 4.0 - length(p); }' > "$scratch/ball.karst"
detail=$("$root/usr/bin/karst" mesh "$scratch/ball.karst" --box -5,-5,-5,5,5,5 --voxel 1 -q -o "$scratch/ball.obj" 2>&1 &&
    $make -s -C "$scratch/stranger" -f minimal.mk mesh CFLAGS="-Wall -Wextra -Werror" 2>&1 &&
    LD_LIBRARY_PATH="$root/usr/lib" "$scratch/stranger/mesh" dunes "$scratch/ball.obj" "$scratch/mesh.png" 30 120 2>&1)
echo "$detail" | grep -q 'the mesh has [1-9][0-9]* pixels, [0-9]* of them in land.s shadow; its own lies on [1-9]'
result "demos/mesh.c builds, and draws a mesh in land with the shadows of both"
detail=$(${CC:-cc} -std=c11 demos/minimal.c $(pkg-config --cflags karst) "$root/usr/lib/libkarst.a" \
    $(pkg-config --static --libs karst | sed 's/-lkarst//') -o "$scratch/stranger/static" 2>&1) &&
    "$scratch/stranger/static" hills "$scratch/static.png" > /dev/null &&
    cmp -s "$scratch/minimal.png" "$scratch/static.png"
result "it links statically too, and the picture is the same"
# ---- CMake ----
if command -v cmake > /dev/null 2>&1; then
    mkdir "$scratch/cmake" && cp demos/minimal.c "$scratch/cmake" && cat > "$scratch/cmake/CMakeLists.txt" << END
cmake_minimum_required(VERSION 3.16)
project(stranger C)
find_package(karst ${version%.*} REQUIRED)
add_executable(shared minimal.c)
target_link_libraries(shared PRIVATE karst::karst)
add_executable(static minimal.c)
target_link_libraries(static PRIVATE karst::static)
END
    detail=$(cmake -S "$scratch/cmake" -B "$scratch/cmake/build" -DCMAKE_PREFIX_PATH="$root/usr" 2>&1 &&
        cmake --build "$scratch/cmake/build" 2>&1)
    result "find_package(karst): a project builds"
    detail=$("$scratch/cmake/build/shared" hills "$scratch/shared.png" 2>&1 &&
        "$scratch/cmake/build/static" hills "$scratch/also.png" 2>&1)
    cmp -s "$scratch/minimal.png" "$scratch/shared.png" && cmp -s "$scratch/minimal.png" "$scratch/also.png"
    result "shared and static, with the same picture"
    sed -i "s/find_package(karst [0-9.]*/find_package(karst 99/" "$scratch/cmake/CMakeLists.txt"
    detail=$(cmake -S "$scratch/cmake" -B "$scratch/cmake/other" -DCMAKE_PREFIX_PATH="$root/usr" 2>&1)
    [ $? -ne 0 ] && echo "$detail" | grep -q '"99"'
    result "a version that is not there is refused"
else
    skip "CMake's package file" "no cmake"
fi

detail=$("$root/usr/bin/karst" render hills -q --size 64x48 -o "$scratch/command.png" 2>&1)
result "the installed command renders"
detail=$(unset KARST_DATA_DIR; "$root/usr/bin/karst" render asteroid --path orbit --frames 1 -q --size 64x48 -o "$scratch/orbit.png" 2>&1)
[ $? -eq 0 ] && [ -s "$scratch/orbit.png" ]
result "and flies a path that was installed with it"

# ---- what the desktop and the shells look for ----
share="$root/usr/share"
detail=$(find "$share" | sed "s|$root||")
[ -s "$share/man/man1/karst.1" ] && [ -s "$share/applications/karst.desktop" ] &&
    [ -s "$share/icons/hicolor/256x256/apps/karst.png" ] && [ -s "$share/bash-completion/completions/karst" ] &&
    [ -s "$share/zsh/site-functions/_karst" ]
result "manual, desktop file, icon and completions are there"
missing=
for word in $("$root/usr/bin/karst" --help | sed -n 's/^  karst \([a-z]*\)  .*/\1/p'); do
    grep -qi "^\.SH KARST $word" "$share/man/man1/karst.1" || missing="$missing $word"
    for option in $("$root/usr/bin/karst" help "$word" | grep -oE -e '^ +(-[a-z], )? *--[a-z-]+' | grep -oE -e '--[a-z-]+'); do
        grep -q -e "$(echo "$option" | sed 's/-/\\\\-/g')" "$share/man/man1/karst.1" || missing="$missing $option"
    done
done
detail="missing:$missing"
[ -z "$missing" ]
result "the manual has every command and option"
detail=$("$root/usr/bin/karst" view --keys text | sed -n 's/^    \([^ ].*\)  *.*/\1/p' | head -n 3)
"$root/usr/bin/karst" view --keys text | grep -q 'W A S D' && grep -q '"W A S D"' "$share/man/man1/karst.1"
result "and the keys"
if command -v man > /dev/null 2>&1; then
    detail=$(LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=100 man --warnings -l "$share/man/man1/karst.1" 2>&1 > /dev/null)
    [ -z "$detail" ]
    result "it is well formed"
fi
grep -q '^Exec=karst view' "$share/applications/karst.desktop" && grep -q '^Icon=karst$' "$share/applications/karst.desktop"
result "the desktop file starts the viewer"
head -c 8 "$share/icons/hicolor/256x256/apps/karst.png" | od -An -c | grep -q 'P   N   G'
result "the icon is a PNG"
# complete WORDS...: what bash would offer for the last of them.
complete()
{
    PATH="$root/usr/bin:$PATH" KARST_DATA_DIR= bash -c '
        . "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _karst; printf "%s\n" "${COMPREPLY[@]}"' \
        bash "$share/bash-completion/completions/karst" "$@" 2>&1
}
detail=$(complete karst re; complete karst render --no-sh; complete karst view alp; complete karst view hills --mode w)
[ "$(echo $detail)" = "render --no-shadows alps walk" ]
result "bash completes commands, options, worlds and values"
if command -v zsh > /dev/null 2>&1; then
    detail=$(zsh -n "$share/zsh/site-functions/_karst" 2>&1)
    result "zsh reads its completion"
fi

if command -v fish > /dev/null 2>&1; then
    detail=$(PATH="$root/usr/bin:$PATH" fish -c "source '$share/fish/vendor_completions.d/karst.fish'; complete -C 'karst re'" 2>&1)
    echo "$detail" | grep -q '^render'
    result "fish completes commands"
else
    grep -q "complete -c karst" "$share/fish/vendor_completions.d/karst.fish"
    result "the completion for fish is there"
fi

unset PKG_CONFIG_PATH PKG_CONFIG_SYSROOT_DIR # Karst's own builds ask for others' packages
# ---- folders with names that shells take apart ----
odd="$scratch/a b's \"c\"" near="$scratch/a"
mkdir -p "$near/usr/bin" && echo mine > "$near/usr/bin/karst"
detail=$($make -s install DESTDIR="$odd" PREFIX=/usr 2>&1) && [ -x "$odd/usr/bin/karst" ] &&
    [ -e "$odd/usr/lib/pkgconfig/karst.pc" ] && [ -e "$odd/usr/share/karst/worlds/hills.karst" ] &&
    [ -e "$odd/usr/share/man/man1/karst.1" ] && [ "$(ls "$near/usr")" = bin ]
result "a DESTDIR with blanks and quotes"
detail=$($make -s uninstall DESTDIR="$odd" PREFIX=/usr 2>&1 > /dev/null; [ ! -e "$odd" ] || find "$odd" ! -type d; [ ! -e "$odd" ] || find "$odd" -path '*/karst*')
[ -z "$detail" ] && [ "$(cat "$near/usr/bin/karst")" = mine ]
result "uninstall takes that away, and nothing else"

# ---- building elsewhere ----
elsewhere=$(mktemp -d) && mkdir "$elsewhere/release" && cp -a "$BUILD"/*.mk "$elsewhere"
for part in core producers cache raycast reference demos embedded_kernels.c embedded_kernels.o flags kernels objects prefix; do
    cp -a "$BUILD/release/$part" "$elsewhere/release"
done
detail=$($make -s BUILD="$elsewhere" "$elsewhere/karst" 2>&1) &&
    [ -x "$elsewhere/karst" ] && (unset KARST_DATA_DIR; cd / && "$elsewhere/karst" check hills > /dev/null)
result "BUILD= elsewhere: the command finds its worlds"
rm -rf "$elsewhere"
detail=$($make -s BUILD=/proc/nowhere 2>&1)
[ $? -ne 0 ] && echo "$detail" | grep -q '/proc/nowhere cannot be written: .*make BUILD='
result "where the build folder cannot be written: what to do"
detail=$($make -s BUILD="$scratch/a b" 2>&1)
[ $? -ne 0 ] && echo "$detail" | grep -q 'holds a blank'
result "a build folder with a blank is refused"

# ---- gone without a trace ----
detail=$($make -s uninstall DESTDIR="$root" PREFIX=/usr 2>&1)
result "make uninstall"
detail=$(find "$root" ! -type d; find "$root" -path '*karst*')
[ -z "$detail" ]
result "uninstall leaves nothing of Karst"
finish
