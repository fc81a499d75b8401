/* A world's own lights: what headers say of them, and what is said of headers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/language/world_text.h"

#define DENSITY "float density(vec3 p) { return -p.y; }\n"

static void what_headers_say(void **state)
{
    (void)state;
    text_world w = world_from_text(
        "/*{ \"voxel\": 0.25, \"sun\": { \"colour\": [0, 0.5, 1] }, \"lights\": [\n"
        "{ \"position\": [\"1e15\", -2, 0.5], \"colour\": [3, 2, 1], \"radius\": 0.25 },\n"
        "{ \"kind\": \"spot\", \"position\": [0, 0, 0], \"azimuth\": 9, \"angle\": 20, \"soft\": 1, "
        "\"shadow\": false },\n"
        "{ \"kind\": \"sun\", \"size\": 3 }] }*/\n" DENSITY);
    const karst_world_header *h = &w.program->header;
    const karst_header_light *l = h->lights;
    assert_int_equal(h->num_lights, 3);
    assert_true(h->has_sun_colour && h->sun_colour[1] == 0.5);
    assert_true(l[0].kind == KARST_HEADER_POINT && l[0].colour[0] == 3 && l[0].radius_m == 0.25 && l[0].shadow);
    assert_string_equal(l[0].position[0], "1000000000000000");
    assert_true(l[1].kind == KARST_HEADER_SPOT && l[1].azimuth_deg == 9 && l[1].elevation_deg == -90);
    assert_true(l[1].angle_deg == 20 && l[1].soft == 1 && !l[1].shadow && l[1].colour[2] == 1);
    assert_true(l[2].kind == KARST_HEADER_SUN && l[2].size_deg == 3 && l[2].elevation_deg == 40);
    world_finish(&w);
    w = world_from_text(DENSITY);
    assert_true(w.program->header.num_lights == 0 && !w.program->header.has_sun_colour);
    world_finish(&w);
}

#define SUNS_4 "{\"kind\": \"sun\"}, {\"kind\": \"sun\"}, {\"kind\": \"sun\"}, {\"kind\": \"sun\"}"

/* Each names the place of the light that is wrong, not of another with such a key. */
static const struct {
    const char *header, *said;
} cases[] = {
    {"{ \"lights\": [{}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}] }",
     "w.karst:1:5: 17 lights: a world may have 16 beside its sun"},
    {"{ \"camera\": { \"position\": [0, 2, 0] }, \"lights\": [{ \"kind\": \"sun\" },\n "
     "{ \"position\": [\"1e99\", 0, 0] }] }",
     "w.karst:2:4: \"position\" is three decimals, in metres: \"1e99\" lies beyond"},
    {"{ \"lights\": [{ \"position\": [0, \"inf\", 0] }] }",
     "w.karst:1:18: \"position\" is three decimals, in metres: "},
    {"{ \"lights\": [{ \"kind\": \"moon {\" }] }", "w.karst:1:18: no light is a \"moon {\""},
    {"{ \"lights\": [{ \"kind\": \"sun }\" },\n{ \"kind\": \"x\" }] }", "w.karst:1:18: no light is a \"sun }\""},
    {"{ \"lights\": [{ \"position\": [0, 0, 0] },\n{ \"position\": [0, 1, 0], \"radius\": \"nan\" }] }",
     "w.karst:2:26: \"radius\" is a number from 0 to 1e+12"},
    {"{ \"lights\": [{ \"kind\": \"sun\", \"colour\": [1, -1, 1] }] }",
     "w.karst:1:33: \"colour\" is a number from 0 to 1000"},
    {"{ \"lights\": [{ \"kind\": \"point\" }] }", "w.karst:1:18: this light has no \"position\""},
    {"{ \"lights\": [{ \"kind\": \"sun\", \"shadow\": 1 }] }", "w.karst:1:33: \"shadow\" is true or false"},
    {"{ \"lights\": 3 }", "w.karst:1:5: \"lights\" is a list"},
    {"{ \"lights\": [3] }", "\"lights\" is an object in braces"},
    {"{ \"lights\": [" SUNS_4 ",\n" SUNS_4 ",\n{\"kind\": \"sun\"}] }", "w.karst:1:5: more than 8 lights cast shadows"},
};

static void what_is_said_of_headers(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024];
        bool ok;
        karst_error error = {0};
        snprintf(text, sizeof text, "/*%s*/\n" DENSITY, cases[i].header);
        karst_program_graph *program =
            karst_language_compile("w.karst", text, strlen(text), NULL, 0, &ok, &error);
        assert_non_null(program);
        assert_false(ok);
        assert_int_equal(error.status, KARST_BAD_WORLD);
        if (!strstr(error.message, cases[i].said))
            fail_msg("%s:\n%s\n--- instead of\n%s", cases[i].header, error.message, cases[i].said);
        karst_program_graph_destroy(program);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_headers_say),
        cmocka_unit_test(what_is_said_of_headers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
