/* A mesh drawn by OpenGL in Karst's land: both hide one another, and each throws its shadow on the other.
 *
 * Use: ./mesh WORLD MESH.obj OUT.png [METRES [AHEAD_M]]: the mesh becomes METRES high (20) and stands on the land
 * AHEAD_M before the camera (60). Build: make -f minimal.mk mesh (libosmesa6-dev and an installed libkarst).
 *
 * What is exact: which of the two is seen, pixel by pixel, and where land shadows the mesh (true rays to the sun). What
 * is not: the mesh's shadow on land comes from a depth picture of the mesh as the sun sees it, of SUN_PX pixels, and
 * what is dark there keeps the share of its light that land in shadow has in the mean of the picture; the mesh has no
 * light from the land. */
#include <karst/karst.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <GL/osmesa.h>

enum { WIDTH_PX = 960, HEIGHT_PX = 540, NUM_PX = WIDTH_PX * HEIGHT_PX, SUN_PX = 1024, MAX_CORNERS = 64 };
#define SAMPLE_PX 97 /* of so many pixels of land one is asked whether it lies in shadow */
#define SUN_REACH_M 3000.0

typedef struct {
    float *points; /* x, y, z; Karst's axes, metres from the camera */
    float *normals;
    unsigned *corners; /* three a triangle */
    size_t num_points, num_corners;
} mesh;

static int fail(const char *what, const char *why)
{
    fprintf(stderr, "mesh: %s%s%s\n", what, *why ? ": " : "", why);
    return KARST_FAILED;
}

/* Room for one more, doubled as it runs out. */
static void *grow(void *old, size_t num, size_t size_bytes)
{
    if (num & (num - 1))
        return old;
    void *wider = realloc(old, (num ? 2 * num : 1) * size_bytes);
    if (!wider)
        exit(fail("out of memory", ""));
    return wider;
}

/* v and f lines of an OBJ; z is negated, as Karst's axes are left-handed. */
static bool read_obj(const char *path, mesh *m)
{
    FILE *file = fopen(path, "r");
    char line[4096];
    *m = (mesh){0};
    while (file && fgets(line, sizeof line, file)) {
        float p[3];
        if (sscanf(line, "v %f %f %f", &p[0], &p[1], &p[2]) == 3) {
            m->points = grow(m->points, m->num_points, 3 * sizeof(float));
            p[2] = -p[2];
            memcpy(m->points + 3 * m->num_points++, p, sizeof p);
        } else if (line[0] == 'f' && line[1] == ' ') {
            long face[MAX_CORNERS];
            int num = 0;
            for (char *at = line + 2, *end; num < MAX_CORNERS; at = end + strcspn(end, " \t\r\n")) {
                face[num] = strtol(at, &end, 10);
                if (end == at)
                    break;
                face[num] = face[num] < 0 ? (long)m->num_points + face[num] : face[num] - 1;
                if (face[num] < 0 || face[num] >= (long)m->num_points)
                    break;
                num++;
            }
            for (int i = 2; i < num; i++)
                for (int c = 0; c < 3; c++) {
                    m->corners = grow(m->corners, m->num_corners, sizeof *m->corners);
                    m->corners[m->num_corners++] = (unsigned)face[c == 0 ? 0 : i - 2 + c];
                }
        }
    }
    if (file)
        fclose(file);
    return m->num_corners > 0;
}

static void subtract(const float *a, const float *b, double d[3])
{
    for (int i = 0; i < 3; i++)
        d[i] = (double)a[i] - b[i];
}

/* The mean of the faces around each point, by their areas; towards the viewer when they are drawn. */
static void find_normals(mesh *m)
{
    m->normals = calloc(m->num_points, 3 * sizeof(float));
    if (!m->normals)
        exit(fail("out of memory", ""));
    for (size_t t = 0; t < m->num_corners; t += 3) {
        const unsigned *c = m->corners + t;
        double u[3], v[3];
        subtract(m->points + 3 * c[1], m->points + 3 * c[0], u);
        subtract(m->points + 3 * c[2], m->points + 3 * c[0], v);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                m->normals[3 * c[k] + i] += (float)(u[(i + 2) % 3] * v[(i + 1) % 3] - u[(i + 1) % 3] * v[(i + 2) % 3]);
    }
}

/* `height_m` high, its foot in the middle at `foot`. */
static void place(mesh *m, double height_m, const double foot[3])
{
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t p = 0; p < m->num_points; p++)
        for (int i = 0; i < 3; i++) {
            low[i] = fminf(low[i], m->points[3 * p + i]);
            high[i] = fmaxf(high[i], m->points[3 * p + i]);
        }
    const double scale = high[1] > low[1] ? height_m / (high[1] - low[1]) : 1;
    for (size_t p = 0; p < m->num_points; p++)
        for (int i = 0; i < 3; i++) {
            const double from = i == 1 ? low[1] : 0.5 * ((double)low[i] + high[i]);
            m->points[3 * p + i] = (float)(foot[i] + scale * (m->points[3 * p + i] - from));
        }
}

/* Its depths, and (if wanted) what light of the sun each pixel has: the cosine to it, from either side. Top row first.
 */
static void draw(const mesh *m, const float matrix[16], const double to_sun[3], int width, int height, float *depth,
                 float *shine)
{
    const float black[4] = {0, 0, 0, 1}, white[4] = {1, 1, 1, 1};
    const float light[4] = {(float)to_sun[0], (float)to_sun[1], (float)to_sun[2], 0};
    glViewport(0, 0, width, height);
    glClearColor(0, 0, 0, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glEnable(GL_DEPTH_TEST);
    glEnable(GL_LIGHTING);
    glEnable(GL_LIGHT0);
    glEnable(GL_NORMALIZE);
    glLightModeli(GL_LIGHT_MODEL_TWO_SIDE, 1);
    glLightModelfv(GL_LIGHT_MODEL_AMBIENT, black);
    glMaterialfv(GL_FRONT_AND_BACK, GL_AMBIENT_AND_DIFFUSE, white);
    glMatrixMode(GL_MODELVIEW);
    glLoadIdentity();
    glLightfv(GL_LIGHT0, GL_POSITION, light);
    glMatrixMode(GL_PROJECTION);
    glLoadMatrixf(matrix);
    glEnableClientState(GL_VERTEX_ARRAY);
    glEnableClientState(GL_NORMAL_ARRAY);
    glVertexPointer(3, GL_FLOAT, 0, m->points);
    glNormalPointer(GL_FLOAT, 0, m->normals);
    glDrawElements(GL_TRIANGLES, (GLsizei)m->num_corners, GL_UNSIGNED_INT, m->corners);
    for (int y = 0; y < height; y++) {
        glReadPixels(0, height - 1 - y, width, 1, GL_DEPTH_COMPONENT, GL_FLOAT, depth + (size_t)y * (size_t)width);
        if (shine)
            glReadPixels(0, height - 1 - y, width, 1, GL_GREEN, GL_FLOAT, shine + (size_t)y * (size_t)width);
    }
}

/* The mesh as the sun sees it: parallel, its box filling the picture; x and y of clip space, and depth towards it. */
static void sun_matrix(const mesh *m, const double to_sun[3], float matrix[16])
{
    double side[3] = {to_sun[2], 0, -to_sun[0]}, above[3], centre[3] = {0, 0, 0}, radius = 0;
    const double length = hypot(side[0], side[2]);
    for (int i = 0; i < 3; i++)
        side[i] = length > 1e-6 ? side[i] / length : i == 0;
    for (int i = 0; i < 3; i++)
        above[i] = to_sun[(i + 1) % 3] * side[(i + 2) % 3] - to_sun[(i + 2) % 3] * side[(i + 1) % 3];
    for (size_t p = 0; p < m->num_points; p++)
        for (int i = 0; i < 3; i++)
            centre[i] += m->points[3 * p + i] / (double)m->num_points;
    for (size_t p = 0; p < m->num_points; p++) {
        double square = 0;
        for (int i = 0; i < 3; i++)
            square += pow(m->points[3 * p + i] - centre[i], 2);
        radius = fmax(radius, sqrt(square) * 1.01);
    }
    for (int i = 0; i < 4; i++) {
        const double *to = i == 3 ? centre : NULL;
        const double sign = to ? -1 : 1;
        double s = 0, a = 0, t = 0;
        for (int k = 0; k < 3; k++) {
            const double one = to ? to[k] : k == i;
            s += one * side[k];
            a += one * above[k];
            t += one * to_sun[k];
        }
        matrix[4 * i] = (float)(sign * s / radius);
        matrix[4 * i + 1] = (float)(sign * a / radius);
        matrix[4 * i + 2] = (float)(-sign * t / radius);
        matrix[4 * i + 3] = i == 3;
    }
}

/* Whether the mesh stands between a place and the sun. */
static bool is_shadowed(const float matrix[16], const float *sun_depth, const double at[3])
{
    double clip[3];
    for (int i = 0; i < 3; i++)
        clip[i] = matrix[i] * at[0] + matrix[4 + i] * at[1] + matrix[8 + i] * at[2] + matrix[12 + i];
    if (fabs(clip[0]) >= 1 || fabs(clip[1]) >= 1)
        return false;
    const int x = (int)((clip[0] + 1) * 0.5 * SUN_PX), y = (int)((1 - clip[1]) * 0.5 * SUN_PX);
    const double seen = sun_depth[y * SUN_PX + x];
    return seen < 1 && seen < 0.5 + 0.5 * clip[2] - 4.0 / SUN_PX;
}

typedef struct {
    karst_camera camera;
    double right[3], up[3], forward[3];
    double to_sun[3];
} scene;

/* Of length 1. */
static void pixel_direction(const scene *s, int pixel, double direction[3])
{
    const double half = tan(s->camera.fov_deg * (3.14159265358979323846 / 360));
    const double across = (2 * (pixel % WIDTH_PX + 0.5) / WIDTH_PX - 1) * half * WIDTH_PX / HEIGHT_PX;
    const double above = (1 - 2 * (pixel / WIDTH_PX + 0.5) / HEIGHT_PX) * half;
    const double length = sqrt(1 + across * across + above * above);
    for (int i = 0; i < 3; i++)
        direction[i] = (s->forward[i] + across * s->right[i] + above * s->up[i]) / length;
}

/* Which of the asked pixels are in land's shadow, of the surface that lies so many metres along their rays: true rays.
 */
static bool shadows_of_land(const karst_world *world, const scene *s, int voxel_log2_m, const float *depth_m,
                            const bool *asked, bool *dark, karst_error *error)
{
    karst_query_ray *rays = malloc(NUM_PX * sizeof *rays);
    karst_query_hit *hits = malloc(NUM_PX * sizeof *hits);
    int *whose = malloc(NUM_PX * sizeof *whose);
    size_t num = 0;
    for (int i = 0; rays && hits && whose && i < NUM_PX; i++) {
        double d[3];
        if (!asked[i])
            continue;
        pixel_direction(s, i, d);
        for (int k = 0; k < 3; k++) /* from a little above it */
            d[k] = d[k] * (double)depth_m[i] + (0.02 + 0.0004 * (double)depth_m[i]) * s->to_sun[k];
        rays[num].from = karst_position_add_m(s->camera.position, d, voxel_log2_m);
        memcpy(rays[num].direction, s->to_sun, sizeof s->to_sun);
        rays[num].length_m = SUN_REACH_M;
        whose[num++] = i;
    }
    const karst_query_config config = {.footprint_m = 0.1};
    bool done = rays && hits && whose ? karst_query_rays(world, &config, rays, num, hits, error)
                                      : karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < num; i++)
        dark[whose[i]] = hits[i].kind != KARST_QUERY_MISS;
    free(rays);
    free(hits);
    free(whose);
    return done;
}

/* Where land is, so far before the camera. */
static bool find_foot(const karst_world *world, const scene *s, int voxel_log2_m, double ahead_m, double foot[3],
                      karst_error *error)
{
    const double level = hypot(s->forward[0], s->forward[2]);
    const double reach_m = 5000, over[3] = {s->forward[0] / level * ahead_m, reach_m, s->forward[2] / level * ahead_m};
    const karst_position from = karst_position_add_m(s->camera.position, over, voxel_log2_m);
    double down_m;
    uint32_t count;
    bool starts_inside;
    if (!karst_query_heights(world, &(karst_query_config){.footprint_m = 0.1}, &from, 1, 2 * reach_m, 1, &down_m,
                             &count, &starts_inside, error))
        return false;
    if (!count)
        return karst_fail(error, KARST_FAILED, "there is no land %g m ahead", ahead_m);
    for (int i = 0; i < 3; i++)
        foot[i] = over[i] - (i == 1 ? down_m : 0);
    return true;
}

static uint8_t to_byte(double light)
{
    const double c = light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
    return (uint8_t)(255 * fmin(fmax(c, 0), 1) + 0.5);
}

static double to_light(uint8_t byte)
{
    const double c = byte / 255.0;
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

/* How bright land in shadow is, to land in the sun, in red, green and blue, by every SAMPLE_PX-th pixel. */
static bool share_of_shadow(const karst_world *world, const scene *s, int voxel_log2_m, const float *land_m,
                            const uint8_t *rgba, double share[3], karst_error *error)
{
    bool *asked = calloc(NUM_PX, sizeof *asked), *dark = calloc(NUM_PX, sizeof *dark);
    double light[2][3] = {{0}}, num[2] = {0};
    for (int i = 0; asked && i < NUM_PX; i += SAMPLE_PX)
        asked[i] = !isinf(land_m[i]);
    const bool done = asked && dark ? shadows_of_land(world, s, voxel_log2_m, land_m, asked, dark, error)
                                    : karst_fail(error, KARST_FAILED, "out of memory");
    for (int i = 0; done && i < NUM_PX; i += SAMPLE_PX)
        if (asked[i]) {
            for (int k = 0; k < 3; k++)
                light[dark[i]][k] += to_light(rgba[4 * i + k]);
            num[dark[i]]++;
        }
    for (int k = 0; k < 3; k++)
        share[k] = light[0][k] > 0 && num[1] > 0 ? fmin(light[1][k] * num[0] / (light[0][k] * num[1]), 1) : 0.3;
    free(asked);
    free(dark);
    return done;
}

int main(int argc, char **argv)
{
    if (argc < 4 || argc > 6) {
        fprintf(stderr, "usage: mesh WORLD MESH.obj OUT.png [METRES [AHEAD_M]]\n");
        return KARST_USAGE;
    }
    const double height_m = argc > 4 ? atof(argv[4]) : 20, ahead_m = argc > 5 ? atof(argv[5]) : 60;
    mesh m;
    if (!(height_m > 0) || !(ahead_m > 0))
        return fail("METRES and AHEAD_M are above 0", "");
    if (!read_obj(argv[2], &m))
        return fail(argv[2], "no faces could be read from it");
    karst_error error = {0};
    const karst_engine_config config = {
        .world = argv[1], .width_px = WIDTH_PX, .height_px = HEIGHT_PX, .display = KARST_DISPLAY_NONE};
    karst_world *world = karst_world_open(&(karst_world_config){.world = argv[1]}, &error);
    karst_engine *engine = world ? karst_engine_create(&config, &error) : NULL;
    if (!engine)
        return fail(error.message, "");
    const int voxel_log2_m = karst_engine_voxel_log2_m(engine);
    const karst_sun sun = karst_engine_get_sun(engine);
    scene s = {.camera = karst_engine_camera(engine)};
    karst_camera_axes(&s.camera, s.right, s.up, s.forward);
    const karst_camera at_sun = {.yaw_deg = sun.azimuth_deg, .pitch_deg = sun.elevation_deg, .fov_deg = 60};
    double unused[2][3], foot[3];
    karst_camera_axes(&at_sun, unused[0], unused[1], s.to_sun);
    if (!find_foot(world, &s, voxel_log2_m, ahead_m, foot, &error))
        return fail(error.message, "");
    place(&m, height_m, foot);
    find_normals(&m);

    /* The rasteriser's part: the mesh as the camera and as the sun see it. */
    const karst_depth_range range = {.near_m = 0.5, .far_m = 20000};
    float *mesh_m = malloc(NUM_PX * sizeof(float)), *shine = malloc(NUM_PX * sizeof(float));
    float *sun_depth = malloc(SUN_PX * SUN_PX * sizeof(float)), *land_m = malloc(NUM_PX * sizeof(float));
    uint8_t *rgba = malloc(NUM_PX * 4), *buffer = malloc((size_t)SUN_PX * SUN_PX * 4);
    bool *dark = calloc(NUM_PX, 1), *asked = calloc(NUM_PX, 1), *is_mesh = calloc(NUM_PX, 1), settled = false;
    OSMesaContext context = OSMesaCreateContextExt(OSMESA_RGBA, 32, 0, 0, NULL);
    if (!mesh_m || !shine || !sun_depth || !land_m || !rgba || !buffer || !dark || !asked || !is_mesh || !context ||
        !OSMesaMakeCurrent(context, buffer, GL_UNSIGNED_BYTE, SUN_PX, SUN_PX))
        return fail("out of memory, or no OSMesa", "");
    float matrix[16], from_sun[16];
    if (!karst_depth_matrix(&s.camera, WIDTH_PX, HEIGHT_PX, &range, matrix, &error))
        return fail(error.message, "");
    draw(&m, matrix, s.to_sun, WIDTH_PX, HEIGHT_PX, mesh_m, shine);
    sun_matrix(&m, s.to_sun, from_sun);
    draw(&m, from_sun, s.to_sun, SUN_PX, SUN_PX, sun_depth, NULL);

    /* Karst's part: land as far as the mesh, and where it shadows the mesh. */
    double share[3];
    if (!karst_depth_from_window(&s.camera, WIDTH_PX, HEIGHT_PX, &range, mesh_m, mesh_m, &error) ||
        !karst_engine_set_depth(engine, mesh_m, NUM_PX, &error) ||
        !karst_engine_settle(engine, 0, NULL, NULL, &settled, &error) ||
        !karst_engine_read_pixels(engine, rgba, NUM_PX * 4, &error) ||
        !karst_engine_read_depth(engine, land_m, NUM_PX, &error) ||
        !share_of_shadow(world, &s, voxel_log2_m, land_m, rgba, share, &error))
        return fail(error.message, "");
    /* Of each pixel what is nearest: land ends at the mesh, so where there is land, it is before the mesh. */
    for (int i = 0; i < NUM_PX; i++) {
        double d[3];
        is_mesh[i] = isinf(land_m[i]) && !isinf(mesh_m[i]);
        if (!is_mesh[i])
            mesh_m[i] = land_m[i];
        pixel_direction(&s, i, d);
        for (int k = 0; k < 3; k++)
            d[k] *= (double)mesh_m[i];
        asked[i] = is_mesh[i] ? shine[i] > 0 : !isinf(mesh_m[i]) && is_shadowed(from_sun, sun_depth, d);
    }
    if (!shadows_of_land(world, &s, voxel_log2_m, mesh_m, asked, dark, &error))
        return fail(error.message, "");
    size_t num_mesh = 0, num_dark = 0, num_land = 0;
    const double albedo[3] = {0.62, 0.2, 0.12}, sky[3] = {0.2, 0.24, 0.32};
    for (int i = 0; i < NUM_PX; i++) {
        const bool shadowed = !is_mesh[i] && asked[i] && !dark[i]; /* land in the sun, but for the mesh */
        for (int k = 0; k < 3 && (is_mesh[i] || shadowed); k++)
            rgba[4 * i + k] = to_byte(shadowed ? share[k] * to_light(rgba[4 * i + k])
                                               : albedo[k] * (sky[k] + (dark[i] ? 0 : 1.1 * shine[i])));
        num_mesh += is_mesh[i];
        num_dark += is_mesh[i] && dark[i];
        num_land += shadowed;
    }
    if (!karst_image_write_png(argv[3], rgba, WIDTH_PX, HEIGHT_PX, &error))
        return fail(error.message, "");
    printf("%s: the mesh has %zu pixels, %zu of them in land's shadow; its own lies on %zu of land\n", argv[3],
           num_mesh, num_dark, num_land);
    OSMesaDestroyContext(context);
    karst_engine_destroy(engine);
    karst_world_close(world);
    free(mesh_m), free(shine), free(sun_depth), free(land_m), free(rgba), free(buffer);
    free(dark), free(asked), free(is_mesh);
    free(m.points), free(m.normals), free(m.corners);
    return KARST_OK;
}
