#!/bin/sh
# The standard benchmark (make bench): what docs/PERFORMANCE.md shows. Everything is judged by ratios: a settled frame to
# the floor kernel that took turns with it, production to the ceilings of the same process, two views by their ratios to
# their own floors. KARST is the command, KARST_BENCH_PROGRAMS a folder with tests/*/bench_* built; PARTS="settled
# flight" does some parts only; KARST_BENCH_OUT keeps the reports.
set -u
karst=${KARST:-build/karst}
programs=${KARST_BENCH_PROGRAMS:-build/release/tests}
flatten=tests/cli/flatten.awk
out=${KARST_BENCH_OUT:-$(mktemp -d)} || exit 1
[ -n "${KARST_BENCH_OUT:-}" ] || trap 'rm -rf "$out"' EXIT
mkdir -p "$out" || exit 1
# An 8-octave fBm and nothing else.
echo 'float density(vec3 p) { return 300.0 * fbm(p / 1024.0, 8) - p.y; }' > "$out/fbm.karst"
# The same, warped.
cat > "$out/warped.karst" << 'END'
float density(vec3 p)
{
    vec3 q = p + 40.0 * vec3(noise(p / 256.0), noise(p / 256.0 + 7.5), noise(p / 256.0 + 17.0));
    return 300.0 * fbm(q / 1024.0, 8) - p.y;
}
END
parts=${PARTS:-settled light media points textures flight size pool distance lanes production bounds start collect}
wants() { case " $parts " in *" $1 "*) ;; *) return 1 ;; esac; }

# bench NAME ARGUMENT...: leaves NAME.json and NAME.flat; says why not.
bench()
{
    name=$1
    shift
    if "$karst" bench "$@" -q --json "$out/$name.json" > "$out/$name.txt" 2>&1; then
        awk -f $flatten "$out/$name.json" | sed 's/ = / /; s/"//g' > "$out/$name.flat"
    else
        echo "    karst bench $*: $(tail -n 1 "$out/$name.txt")"
        rm -f "$out/$name.flat"
        return 1
    fi
}
# get NAME FIGURE
get() { awk -v name="$2" '$1 == name { print $2; exit }' "$out/$1.flat"; }
calc() { awk "BEGIN { printf \"%.4g\", $1 }"; }
# line TEXT VALUE UNIT [MARK OP]: OP is at-most or at-least.
line()
{
    verdict=
    [ $# -lt 5 ] || verdict=$(awk -v v="$2" -v m="$4" -v op="$5" 'BEGIN {
        ok = op == "at-most" ? v + 0 <= m + 0 : v + 0 >= m + 0
        printf "  mark: %s %s%s", op == "at-most" ? "at most" : "at least", m, ok ? "" : "  NOT MET" }')
    printf '    %-58s %9s %-14s%s\n' "$1" "$(awk -v v="$2" 'BEGIN { printf((v >= 100 ? "%.0f" : v >= 1 ? "%.2f" : "%.3f"), v) }')" \
        "$3" "$verdict"
}
few="--runs 3 --rounds 31"
one="--runs 1 --rounds 11"

echo "Karst's standard benchmark: $("$karst" --version 2> /dev/null | sed -n 1p), one voxel a pixel, medians"

if wants settled; then
    echo; echo "Settled frames, every ray recast"
    for world in hills karst; do
        for size in 800x600 1280x720; do
            bench $world-$size $world --size $size --no-shadows $few || continue
            line "$world $size, no shadows" "$(get $world-$size ratios.settled_frame_per_floor.median)" "x floor" 4 at-most
            line "" "$(get $world-$size settled.time_ms.frame.median)" "ms"
        done
        bench $world-shadows $world --size 800x600 --beside no-shadows $few || continue
        line "$world 800x600, sun shadows" "$(get $world-shadows ratios.settled_frame_per_frame_without_shadows.median)" \
            "x the frame without" 1.8 at-most
        most=2
        [ $world = karst ] && most=3
        line "$world: bricks used / bricks hit" "$(get $world-800x600 ratios.used_bricks_per_hit_brick.median)" "" $most \
            at-most
    done
    [ -e "$out/hills-800x600.flat" ] &&
        line "hills 800x600: memory of what the view uses" "$(calc "$(get hills-800x600 cache.used_bytes) * 1e-6")" MB 100 at-most
fi

# Rays after the camera's. A ball of glass fills half of the picture; without it there is its ground alone.
if wants light; then
    echo; echo "Mirrors, clear matter and lights: 800x600, sun shadows"
    cat > "$out/ground.karst" << 'END'
/*{ "voxel": 0.00390625, "view": 120, "camera": { "position": ["0", "1", "-3.2"], "pitch": -4, "fov": 50 },
    "sun": { "azimuth": 305, "elevation": 38 } }*/
float density(vec3 p) { return 0.2 * fbm(p / 0.7, 6) - p.y; }
END
    cat "$out/ground.karst" - > "$out/ball.karst" << 'END'
float clear(vec3 p) { return 1.0 - length(p - vec3(0.0, 0.9, 0.0)); }
material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }
END
    if bench light-mirror hills --size 800x600 --mirror 1 --beside no-mirror $one; then
        line "hills, all of it a mirror" "$(get light-mirror ratios.settled_frame_per_frame_without_mirror.median)" \
            "x the frame without" 1.6 at-most
        line "  a mirrored ray, cast" "$(calc "$(get light-mirror settled.streams.mirror.ns_per_ray.median) / \
            $(get light-mirror settled.streams.primary.ns_per_ray.median)")" "x a camera's" 1.6 at-most
    fi
    # of frame WORLD, in floors of its own run
    floors() { bench "light-$1" "$2" --size 800x600 $one && get "light-$1" ratios.settled_frame_per_floor.median; }
    ground=$(floors ground "$out/ground.karst") && ball=$(floors ball "$out/ball.karst") &&
        line "a ball of glass over half the picture" "$(calc "$ball / $ground")" "x the frame without" 2.2 at-most
    hills=$(floors hills hills) && lake=$(floors lake lake) &&
        line "lake" "$(calc "$lake / $hills")" "x hills" 3 at-most
    [ -n "$hills" ] && lanterns=$(floors lanterns lanterns) &&
        line "lanterns, 16 lights" "$(calc "$lanterns / $hills")" "x hills"
    [ -x "$programs/bench/bench_standard_caustics" ] && "$programs/bench/bench_standard_caustics"
fi

# A scanned rabbit that fills the picture, as a surface and as discs, against a body of noise.
if wants points; then
    echo; echo "Models of points: 800x600, no shadows"
    scan=../shared/data/stanford-bunny.obj
    if [ -r "$scan" ] && "$karst" import "$scan" -q -o "$out/rabbit.karstpoints"; then
        for as in surface splats; do
            cat > "$out/rabbit-$as.karst" << END
/*{ "voxel": 0.0009765625, "view": 40, "camera": { "position": ["-0.12", "-0.3", "-1.2"], "fov": 22 },
    "sun": { "azimuth": 200, "elevation": 40 },
    "models": [{ "points": "rabbit.karstpoints", "turn": [0, 180, 0], "scale": 10, "as": "$as" }] }*/
float density(vec3 p) { return -p.y - 3.0; }
END
        done
        points_floors() { bench "points-$1" "$2" --size 800x600 --no-shadows $one && get "points-$1" ratios.settled_frame_per_floor.median; }
        asteroid=$(points_floors asteroid asteroid) && surface=$(points_floors surface "$out/rabbit-surface.karst") &&
            line "rabbit over all of the picture, as a surface" "$(calc "$surface / $asteroid")" "x asteroid" 1.3 at-most
        [ -n "$asteroid" ] && splats=$(points_floors splats "$out/rabbit-splats.karst") &&
            line "the same as splats" "$(calc "$splats / $asteroid")" "x asteroid"
    else
        echo "    no $scan"
    fi
fi

# Files of three channels over all of hills, one and two, against hills: shading alone. As for media, they take turns.
if wants textures; then
    echo; echo "Textures in colours: hills, 800x600, no shadows"
    data='"data": { "rock": { "file": "rock.png", "wrap": "repeat" }, "turf": { "file": "turf.png", "wrap": "repeat" } },'
    cp demos/worlds/data/rock.png demos/worlds/data/turf.png "$out"
    more=
    for texture in "rock, p, n, 9.0" "turf, p, n, 4.0"; do
        more="$more * (0.5 + texture($texture))"
        sed -e "s|\"seed\": 1,|& $data|" -e "s|return mix(stone, grass.*n.y))|&$more|" demos/worlds/hills.karst > \
            "$out/textured-${texture%%,*}.karst"
    done
    shading() { bench textures "$1" --size 800x600 --no-shadows $one && get textures settled.time_ms.shade.median; }
    added() # WORLD
    {
        for turn in 1 2 3 4 5; do
            without=$(shading hills) && with=$(shading "$1") && calc "$with / $without - 1" && echo
        done | sort -n | awk '{ ratio[NR] = $1 } END { if (NR < 5) exit 1; print ratio[3] }'
    }
    share=$(added "$out/textured-rock.karst") && line "one" "$share" "of shading" 0.25 at-most
    share=$(added "$out/textured-turf.karst") && line "two" "$share" "of shading"
fi

# Media, settled, and smoke whose particles all move. Without particles the air is empty.
if wants media; then
    echo; echo "Media: 800x600, sun shadows"
    # of frame WORLD [OPTION...], in floors of its own run
    media_floors()
    {
        media_name=$1
        shift
        bench "media-$media_name" "$@" --size 800x600 $one && get "media-$media_name" ratios.settled_frame_per_floor.median
    }
    # Two frames, and what else runs on the machine changes between their runs: they take turns, and the middle one of
    # their ratios counts. Prints it.
    media_turns() # COMMAND COMMAND
    {
        for turn in 1 2 3 4 5; do
            media_first=$($1) && media_second=$($2) && calc "$media_second / $media_first" && echo
        done | sort -n | awk '{ ratio[NR] = $1 } END { if (NR < 5) exit 1; print ratio[3] }'
    }
    clear_air() { media_floors clear smoke --param particles=0; }
    smoke() { media_floors smoke smoke; }
    hills() { media_floors hills hills; }
    clouds() { media_floors clouds clouds; }
    ratio=$(media_turns clear_air smoke) && line "smoke over a third of the picture" "$ratio" "x the frame without" 2.5 at-most
    ratio=$(media_turns hills clouds) && line "clouds" "$ratio" "x hills" 4 at-most
    for number in 250 1500; do
        bench smoke-$number smoke --size 800x600 --particles $number --frames 10 || break
    done
    if [ -e "$out/smoke-1500.json" ]; then
        # of NUMBER FIGURE
        moving() { sed -n "s/^ *\"$2\": \([0-9.eE+-]*\),*\$/\1/p" "$out/smoke-$1.json" | sed -n 1p; }
        line "1,500 particles move: depth to the sun" \
            "$(calc "$(moving 1500 sun_depth_ms) / $(moving 1500 frame_ms)")" "x the frame" 0.5 at-most
        line "  against that of 250" "$(calc "$(moving 1500 sun_depth_ms) / $(moving 250 sun_depth_ms)")" \
            "x, of 6" 6 at-most
    fi
fi

if wants flight; then
    echo; echo "hills, low-flight, 800x600, no shadows, 8 ms of production a frame"
    # Settled frames at the beginning would be those of another pace than most of the flight: others go beside it.
    if bench flight hills --path low-flight --size 800x600 --no-shadows --runs 3 --rounds 15 --budget 8 --beside standing; then
        line "median" "$(get flight ratios.flight_frame_per_standing_frame.median)" "x settled frame" 1.5 at-most
        line "p99" "$(get flight ratios.flight_p99_per_standing_frame.median)" "x settled frame" 2 at-most
        line "  median, p99 to settled frames before the flight" "$(get flight ratios.flight_frame_per_settled_frame.median)" \
            "$(calc "$(get flight ratios.flight_p99_per_settled_frame.median)") x"
        line "hits at the level asked for, median frame" "$(get flight flight.at_level.median)" ""
        line "hits at the level asked for, 99 % of frames" "$(get flight flight.at_level.p1)" ""
        line "production (CPU time over the cores), median" "$(get flight flight.time_ms.production.median)" ms
        line "production, p99" "$(get flight flight.time_ms.production.p99)" "ms"
    fi
fi

# The cost of each pixel in floors: a floor grows with the pixels too.
if wants size; then
    echo; echo "Frame time against pixels: hills, no shadows"
    base=
    for size in 400x300 800x600 1280x720 1920x1080; do
        bench size-$size hills --size $size --no-shadows --pool 1024 $one || continue
        per_pixel=$(calc "$(get size-$size settled.time_ms.frame.median) * 1e6 / \
            ($(get size-$size width_px) * $(get size-$size height_px))")
        ratio=$(get size-$size ratios.settled_frame_per_floor.median)
        base=${base:-$ratio}
        line "$size" "$per_pixel" "ns a pixel"
        line "  x floor, against 400x300" "$(calc "$ratio / $base")" "" 1.1 at-most
    done
fi

if wants pool; then
    echo; echo "Still frame against the size of the pools: hills, 800x600, 2 pixels a voxel"
    base=
    for pool in 64 512 2048; do
        bench pool-$pool hills --size 800x600 --no-shadows --detail 2 --pool $pool $one || continue
        ratio=$(get pool-$pool ratios.settled_frame_per_floor.median)
        base=${base:-$ratio}
        line "$pool MiB: x floor, against 64 MiB" "$(calc "$ratio / $base")" "" 1.1 at-most
        line "  collect" "$(get pool-$pool settled.time_ms.collect.median)" "ms"
    done
fi

# All rays end within 900 m: what changes is only how deep the tree is.
if wants distance; then
    echo; echo "Still frame against view distance, at the same footprint: hills from 520 m, looking down"
    base=
    for distance in 1e3 1e5 1e7; do
        bench distance-$distance hills --size 800x600 --no-shadows --camera 0,520,0,30,-65 --view-distance $distance $one || continue
        ratio=$(get distance-$distance ratios.settled_frame_per_floor.median)
        base=${base:-$ratio}
        line "$distance m: x floor, against 1e3 m" "$(calc "$ratio / $base")" "" 1.15 at-most
    done
fi

if wants lanes; then
    echo; echo "The same kernels with 1 lane, as GPUs run them, on this device: 400x300, no shadows"
    for world in hills karst; do
        bench lanes-16 $world --size 400x300 --no-shadows --runs 1 --rounds 9 &&
            bench lanes-1 $world --size 400x300 --no-shadows --runs 1 --rounds 3 --lanes 1 || continue
        line "$world: settled frame" "$(calc "$(get lanes-1 settled.time_ms.frame.median) / $(get lanes-16 settled.time_ms.frame.median)")" \
            "x of 16 lanes"
        line "  a brick of production" "$(calc "$(get lanes-16 production.bricks_per_core_s.median) / $(get lanes-1 production.bricks_per_core_s.median)")" \
            "x of 16 lanes"
    done
fi

if wants production; then
    echo; echo "Production while a view settles (800x600, 2 pixels a voxel), per core, in encoded samples"
    for world in fbm warped; do
        bench $world "$out/$world.karst" --camera 0,400,0,30,-15 --size 800x600 --detail 2 --no-shadows --runs 3 --rounds 9 || continue
        line "$world, 8 octaves: loads" "$(calc "$(get $world production.load_voxels_per_core_s.median) * 1e-6")" "Mvoxel/s"
        if [ $world = fbm ]; then
            line "  of the FMA ceiling, at 4 FMA a sample and octave" \
                "$(calc "32 * $(get $world production.load_voxels_per_fma.median)")" "" 0.2 at-least
        else
            line "  x bare pointwise noise" "$(get $world production.load_per_noise.median)" "" 0.9 at-least
        fi
    done
    if bench hills-production hills --size 800x600 --no-shadows --runs 3 --rounds 9; then
        line "hills: all of production" "$(get hills-production production.bricks_per_core_s.median)" "bricks/s" 4000 at-least
        line "  bounds" "$(get hills-production production.bounds_core_us_per_node.median)" "us a node"
        line "  FMA ceiling" "$(calc "$(get hills-production ceilings.fma_per_s.median) * 1e-9")" "Gfma/s, all cores"
        line "  copying memory" "$(calc "$(get hills-production ceilings.memory_bytes_per_s.median) * 1e-9")" "GB/s"
        line "  bare noise, 8 octaves, pointwise" "$(calc "$(get hills-production ceilings.noise_samples_per_s.median) * 1e-6")" \
            "Mvoxel/s, all"
    fi
    [ -x "$programs/bench/bench_standard_noise" ] && "$programs/bench/bench_standard_noise"
fi

if wants start; then
    echo; echo "From the start of the process: hills, 800x600, no shadows"
    KARST_CACHE_DIR=$out/karst-cache POCL_CACHE_DIR=$out/pocl-cache
    export KARST_CACHE_DIR POCL_CACHE_DIR
    if bench start-bare hills --size 800x600 --no-shadows --runs 1 --rounds 1; then
        line "no cache at all: complete picture" "$(calc "$(get start-bare start.process.complete_ms) * 1e-3")" s 8 at-most
        for try in 1 2 3; do
            bench start-$try hills --size 800x600 --no-shadows --runs 1 --rounds 1 || break
        done
        median() { for i in 1 2 3; do get start-$i "start.process.$1"; done | sort -n | sed -n 2p; }
        line "warm caches: device, memory and programs" "$(calc "$(median opened_ms) * 1e-3")" s
        line "  picture without a hole" "$(calc "$(median hole_free_ms) * 1e-3")" s 0.3 at-most
        line "  complete picture" "$(calc "$(median complete_ms) * 1e-3")" s 1.2 at-most
        KARST_CACHE_DIR=off bench start-pocl hills --size 800x600 --no-shadows --runs 1 --rounds 1 &&
            line "  without Karst's cache, only the driver's: opened" "$(calc "$(get start-pocl start.process.opened_ms) * 1e-3")" s
    fi
    unset KARST_CACHE_DIR POCL_CACHE_DIR
fi

# Speed beside a scalar build, bounds beside naive ones, and starts of all shipped worlds.
if wants bounds && [ -x "$programs/bench/bench_standard_production" ]; then
    "$programs/bench/bench_standard_production"
    "$programs/bench/bench_standard_start"
fi
if wants collect && [ -x "$programs/cache/bench_cache" ]; then
    echo; echo "Collect and publish, ms (marks: under 0.5)"
    "$programs/cache/bench_cache" | sed 's/^/    /'
fi
