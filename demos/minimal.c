/* The smallest program on libkarst: one picture of a world.
 * Build: make -f minimal.mk (in this folder, with libkarst installed). Use: ./minimal hills out.png */
#include <karst/karst.h>

#include <stdio.h>
#include <stdlib.h>

#define WIDTH_PX 640
#define HEIGHT_PX 400

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: minimal WORLD OUT.PNG\n");
        return KARST_USAGE;
    }
    karst_error error = {0};
    karst_engine_config config = {.world = argv[1], .width_px = WIDTH_PX, .height_px = HEIGHT_PX};
    karst_engine *engine = karst_engine_create(&config, &error);
    uint8_t *rgba = malloc(WIDTH_PX * HEIGHT_PX * 4);
    bool settled = false;

    /* Each frame casts rays, and produces what they missed; a settled one missed nothing. */
    if (engine && rgba && karst_engine_settle(engine, 0, NULL, NULL, &settled, &error) &&
        karst_engine_read_pixels(engine, rgba, WIDTH_PX * HEIGHT_PX * 4, &error) &&
        karst_image_write_png(argv[2], rgba, WIDTH_PX, HEIGHT_PX, &error)) {
        karst_stats stats;
        karst_engine_stats(engine, &stats);
        printf("%s: %llu of %llu pixels are ground, on %s\n", argv[2], (unsigned long long)stats.num_hits,
               (unsigned long long)stats.num_pixels, stats.device);
    } else if (error.status == KARST_OK) {
        karst_fail(&error, KARST_FAILED, "out of memory");
    }
    if (error.status != KARST_OK)
        fprintf(stderr, "minimal: %s\n", error.message);
    free(rgba);
    karst_engine_destroy(engine);
    return (int)error.status;
}
