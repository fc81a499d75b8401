#!/bin/sh
# Files that are no points, or say that they hold what they do not: each reader of points must say where it is wrong, with exit code 5, within two
# seconds of CPU and 500 MB, and leave nothing behind. $KARST is the program.
set -u
. tests/tap.sh
. tests/cli/calls.sh

# metered.py COMMAND...: its exit status, CPU seconds and MiB resident go to the file figures; a minute at most.
cat > metered.py << 'EOF'
import resource, subprocess, sys
try:
    status = subprocess.run(sys.argv[1:], timeout=60).returncode
except subprocess.TimeoutExpired:
    status = 124
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open("figures", "w") as file:
    file.write("%d %.2f %.0f\n" % (status, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))
EOF

# refused PATTERN FILE: the file is said to be wrong there.
refused()
{
    python3 metered.py "$karst" import "$2" -q -o bad.karstpoints > told 2>&1
    read -r status cpu_s mib < figures
    detail="exit $status, $cpu_s s of CPU, $mib MiB: $(head -c 300 told)"
    awk -v status="$status" -v cpu="$cpu_s" -v mib="$mib" 'BEGIN { exit !(status == 5 && cpu <= 2 && mib <= 500) }' && grep -q "^karst: $2:\{0,1\}.*$1" told &&
        [ "$(wc -l < told)" -eq 1 ] && [ -z "$(find . -name 'bad*')" ]
    result "$2: $1"
}

# bytes NUMBER SEED: the same noise each time.
bytes() { python3 -c 'import random, sys; random.seed(int(sys.argv[2])); sys.stdout.buffer.write(random.randbytes(int(sys.argv[1])))' "$1" "$2"; }
ply_head() { printf 'ply\nformat %s 1.0\nelement vertex %s\nproperty float x\nproperty float y\nproperty float z\nend_header\n' "$1" "$2"; }

for kind in ply obj xyz las; do
    bytes 100000 7 > "noise.$kind"
    ln -s /dev/zero "zeros.$kind"
    ln -s /dev/urandom "endless.$kind"
    : > "empty.$kind"
done
refused "" noise.ply
refused "" noise.obj
refused "" noise.xyz
refused "" noise.las
refused "" zeros.ply
refused "" zeros.obj
refused "" zeros.xyz
refused "" zeros.las
refused "" endless.ply
refused "" endless.obj
refused "" endless.xyz
refused "" endless.las
refused "" empty.ply
refused "" empty.obj
refused "" empty.xyz
refused "" empty.las

# Headers that claim more than there is, cut in the middle of a point, and places that are none.
ply_head ascii 4000000000 > claims.ply && echo 1 2 3 >> claims.ply
refused "1 of 4000000000" claims.ply
ply_head binary_little_endian 4000000000 > claims-binary.ply && bytes 1200 1 >> claims-binary.ply
refused "of 4000000000" claims-binary.ply
ply_head binary_little_endian 99999999999999999999999 > huge.ply
refused "after 0 of" huge.ply
ply_head binary_big_endian 100 > cut.ply && bytes 1195 2 >> cut.ply
refused "99 of 100" cut.ply
{ ply_head ascii 40 && yes "nan inf -inf" | head -n 40; } > nan.ply
refused "have places" nan.ply
{ ply_head ascii 40 && yes "1 2" | head -n 40; } > short.ply
refused ":8:" short.ply
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty list uchar float x\nend_header\n' > list.ply
refused "" list.ply
yes "v nan nan nan" | head -n 40 > nan.obj
refused "have places" nan.obj
{ yes "v 1 2 3" | head -n 40 && echo "f 1 2 4000000000"; } > claims.obj
refused "" claims.obj
yes "nan nan nan" | head -n 40 > nan.xyz
refused "have places" nan.xyz
{ yes "1 2 3" | head -n 40 && echo "1 2 three"; } > word.xyz
refused ":41:" word.xyz
# 227 bytes of head: a version, its own size, where points begin, their format and size, and how many.
python3 - << 'EOF'
import struct
def las(name, num=100, record=20, offset=227, head=227, form=0, scale=0.01, held=100):
    data = bytearray(227)
    data[:4], data[24:26] = b"LASF", bytes([1, 2])
    struct.pack_into("<HI", data, 94, head, offset)
    struct.pack_into("<BHI", data, 104, form, record, num)
    struct.pack_into("<6d", data, 131, scale, scale, scale, 0, 0, 0)
    points = b"".join(struct.pack("<3i", i % 10 * 100, i // 10 * 100, i) + bytes(record - 12) for i in range(held))
    open(name, "wb").write(bytes(data) + points)
las("good.las")
las("claims.las", num=0xffffffff)
las("cut.las", held=50)
las("far.las", offset=0xffffffff)
las("thin.las", record=20, form=3)
las("nan.las", scale=float("nan"))
las("format.las", form=63)
EOF
"$karst" import good.las -q -o good.karstpoints 2> told
detail=$(cat told) result "good.las: is read"
refused "" claims.las
refused "" cut.las
refused "" far.las
refused "" thin.las
refused "" nan.las
refused "" format.las

# Models: what import wrote, cut, changed, and what it never wrote.
look()
{
    python3 metered.py "$karst" info "$1" > told 2>&1
    read -r status cpu_s mib < figures
    detail="exit $status, $cpu_s s of CPU, $mib MiB: $(head -c 300 told)"
    [ "$status" -eq 5 ] && grep -q "^karst: $1" told
    result "$1: is no model"
}
bytes 5000 3 > noise.karstpoints
look noise.karstpoints
ln -s /dev/zero zeros.karstpoints
look zeros.karstpoints
head -c 1600 good.karstpoints > cut.karstpoints
look cut.karstpoints
python3 -c 'd = bytearray(open("good.karstpoints", "rb").read()); d[1700] ^= 4; open("flipped.karstpoints", "wb").write(d)'
look flipped.karstpoints
finish
