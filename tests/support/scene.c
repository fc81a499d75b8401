#include "tests/support/scene.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

karst_engine *scene_open(const karst_engine_config *config)
{
    karst_engine *engine;
    assert_ok(engine = karst_engine_create(config, &error));
    return engine;
}

karst_engine *scene_create(const char *text, const karst_engine_config *like, int width_px, int height_px,
                           karst_error *error)
{
    char path[64] = "/tmp/karst-scene-XXXXXX.karst";
    karst_error own = {0}, *told = error ? error : &own;
    karst_engine_config config = *like;
    const int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    config.world = path;
    config.display = KARST_DISPLAY_NONE;
    config.width_px = width_px;
    config.height_px = height_px;
    config.exposure = KARST_EXPOSURE_GIVEN;
    if (!config.num_bricks && !config.pool_bytes)
        config.pool_bytes = (uint64_t)96 << 20;
    karst_engine *engine = karst_engine_create(&config, told);
    unlink(path);
    if (!engine && !error)
        fail_msg("%s", own.message);
    return engine;
}

void scene_settle(karst_engine *engine, uint32_t max_frames, float *light, size_t num, karst_stats *stats)
{
    bool settled = false;
    karst_stats own, *told = stats ? stats : &own;
    assert_ok(karst_engine_settle(engine, max_frames, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, told);
    assert_true(settled && told->settled);
    assert_int_equal(told->num_provisional, 0);
    assert_int_equal(told->num_incomplete, 0);
    assert_ok(karst_engine_read_radiance(engine, light, num, &error));
}

double scene_mean(const float *light, size_t num)
{
    double sum = 0;
    for (size_t i = 0; i < num; i++)
        sum += (double)light[i];
    return sum / (double)num;
}
