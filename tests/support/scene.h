/* Small worlds from texts, and their settled light: what tests of pictures begin with. */
#ifndef KARST_TESTS_SUPPORT_SCENE_H
#define KARST_TESTS_SUPPORT_SCENE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

/* An engine of a configuration that has to do. */
karst_engine *scene_open(const karst_engine_config *config);

/* An engine of the world `text` without a display, whose exposure does not follow the picture. Of `like` the world and
 * these are not looked at; its size is width_px x height_px, and its pools are 96 MiB if it says nothing of them. NULL
 * with *error if it is refused; without one that fails the test. */
karst_engine *scene_create(const char *text, const karst_engine_config *like, int width_px, int height_px,
                           karst_error *error);

/* Settles a picture in so many frames at most, without stand-ins or holes, and reads its light: num floats. stats may
 * be NULL. */
void scene_settle(karst_engine *engine, uint32_t max_frames, float *light, size_t num, karst_stats *stats);

double scene_mean(const float *light, size_t num);

#endif
