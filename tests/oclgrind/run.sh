#!/bin/sh
# The kernels under oclgrind, a device in software that checks each access: out of bounds, races, reads of what was never
# written, barriers that not all reach. It is several hundred times slower than a device, so frames are tiny, and two
# samples of a pixel must do: one that begins the sum and one that is added. KARST_TEST_FULL=1 draws shipped worlds too.
# Its exit code says nothing: the log does, and must stay empty.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
if ! command -v oclgrind > /dev/null; then
    skip "kernels under oclgrind" "oclgrind is not installed"
    finish
fi
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

# First, that it would notice: a kernel that writes behind its buffer.
cat > "$scratch/bad.cl" << 'END'
__kernel void bad(__global int *out) { out[get_global_id(0) + 1] = 1; }
END
cat > "$scratch/bad.sim" << 'END'
bad.cl
bad
4 1 1
1 1 1
<size=16 fill=0>
END
detail=$(cd "$scratch" && oclgrind-kernel bad.sim 2>&1)
echo "$detail" | grep -q 'Invalid write'
result "oclgrind notices a write behind a buffer"

# clean NAME ARGUMENT...
clean()
{
    name=$1
    shift
    timeout "${OCLGRIND_TIMEOUT_S:-1200}" oclgrind --build-options "-cl-opt-disable -DKARST_BLIND_STAMPS -DKARST_PLAIN_FLOOR" --log "$scratch/log" --check-api --data-races \
        "$karst" render "$@" -o "$scratch/picture.png" --stats "$scratch/stats.json" --lanes 1 --display none -q \
        > "$scratch/talk" 2>&1
    status=$?
    detail="exit $status; $(head -n 5 "$scratch/talk"); $(head -n 40 "$scratch/log")"
    [ $status -eq 0 ] && [ -s "$scratch/picture.png" ] && [ ! -s "$scratch/log" ] &&
        grep -q '"settled": true' "$scratch/stats.json" && grep -q '"device": ".*Oclgrind' "$scratch/stats.json"
    result "$name"
}
cat > "$scratch/land.karst" << 'END'
/*{ "voxel": 0.0625, "view": 200, "camera": { "position": ["0", "30", "0"], "pitch": -12 } }*/
float density(vec3 p) { return 24.0 * fbm(p / 96.0, 1) + 6.0 * ridged(p.xz / 40.0, 1) - p.y; }
vec3 colour(vec3 p, vec3 n) { return mix(vec3(0.4, 0.3, 0.2), vec3(0.1, 0.3, 0.1), smoothstep(0.6, 0.9, n.y)); }
END
clean "land, tiny, under oclgrind" "$scratch/land.karst" --size 14x10 --detail 8 --pool 2 --samples 2
if [ -n "${KARST_TEST_FULL:-}" ]; then
    clean "hills, tiny, under oclgrind" hills --size 18x14 --detail 8 --view-distance 200 --pool 2 --samples 2
    clean "asteroid, tiny, under oclgrind" asteroid --size 14x10 --detail 8 --pool 2 --samples 2
fi
finish
