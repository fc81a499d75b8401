/* Rays from surfaces: see raycast/light/path_starts.h. */
#include "raycast/light/clear_paths_shared.h"
#include "raycast/light/path_ends.clh"
#include "raycast/light/path_rays.clh"
#include "raycast/light/surface.clh"

__kernel K_WIDE void path_starts_leave(karst_pinhole pinhole, float detail, uint sample,
                                       K_GLOBAL const karst_hit *hits, K_GLOBAL karst_ray *rays, K_GLOBAL float *parts)
{
    const vfloat zero = (vfloat)(0.0f), one = (vfloat)(1.0f);
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    path_rays r;
    vint x, y;
    r.valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(r.valid))
        return;
    r.lanes = mask_bits(r.valid);
    r.index = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    const vector3 to = pinhole_direction(&pinhole, x, y);
    const surface_hits s = load_surface(hits, r.index, r.valid, &to, 0.0f, 0.0f);
    const vint on_land = r.valid & v_eq(s.word & (int)KARST_PATH_HIT_CLEAR, (vint)(0)) &
                         (v_eq(s.kind, (vint)((int)KARST_HIT_SURFACE)) |
                          v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL)));
    const jitter on = jitter_on_disc(jitter_of(x + pinhole.x0_px, y + pinhole.y0_px, sample,
                                               karst_path_purpose(0, KARST_PATH_OF_DIRECTION)));
    const vfloat up = k_sqrt(lane_max(k_fma(-on.u, on.u, k_fma(-on.v, on.v, one)), zero));
    r.origin.x = to.x * s.t, r.origin.y = to.y * s.t, r.origin.z = to.z * s.t;
    r.direction = unit_of(about_axis(&s.normal, on.u, on.v, up));
    r.t_max = v_select(on_land, to_end_of_view(&pinhole, &r.origin, &r.direction), zero);
    r.width = lane_max(s.t * pinhole.cone, v_as_float((s.level + 127) << 23) * (vfloat)(1.0001f / detail));
    r.cone = (vfloat)(pinhole.cone > PATH_CONE ? pinhole.cone : PATH_CONE);
    r.throughput.r = r.throughput.g = r.throughput.b = one;
    r.pixel = y << 16 | x;
    r.flags = (vint)(0);
    store_paths(rays, &r, KARST_SIDE_FRONT);
    if (!parts)
        return;
    const vfloat none = v_select(on_land, zero, (vfloat)(-1.0f));
    store_ordered(parts, r.index, r.valid, none);
    store_ordered(parts + plane, r.index, r.valid, none);
    store_ordered(parts + 2 * plane, r.index, r.valid, none);
}
