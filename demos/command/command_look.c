/* Options about how pictures look. */
#include "command.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool parse_sun(const char *text, karst_sun *sun, karst_error *error)
{
    char *end;
    sun->azimuth_deg = strtod(text, &end);
    bool good = end != text && *end == ',';
    if (good) {
        const char *second = end + 1;
        sun->elevation_deg = strtod(second, &end);
        good = end != second && !*end;
    }
    return (good && fabs(sun->azimuth_deg) <= 36000 && fabs(sun->elevation_deg) <= 90) ||
           karst_fail(error, KARST_USAGE,
                      "--sun %.40s: must be two numbers of degrees, such as 120,35: the azimuth from -36000 to 36000, "
                      "the elevation from -90 to 90",
                      text);
}

bool command_check_look(command_look *look, karst_error *error)
{
    if (look->sun && !parse_sun(look->sun, &look->parsed_sun, error))
        return false;
    if (look->light && !karst_integrator_parse(look->light, &look->parsed_light, error))
        return false;
    look->parsed_tone = KARST_TONE_OF_FILM;
    if (look->tone && !karst_tone_parse(look->tone, &look->parsed_tone, error))
        return false;
    if (look->media && !karst_media_mode_parse(look->media, &look->parsed_media, error))
        return false;
    if (look->scattering && !karst_scattering_parse(look->scattering, &look->parsed_scattering, error))
        return false;
    look->has_exposure = look->exposure != NULL;
    look->auto_exposure = look->exposure && strcmp(look->exposure, "auto") == 0;
    if (!look->exposure || look->auto_exposure)
        return true;
    char *end;
    look->exposure_stops = strtod(look->exposure, &end);
    if (end != look->exposure && !*end && look->exposure_stops >= -KARST_ENGINE_MAX_EXPOSURE &&
        look->exposure_stops <= KARST_ENGINE_MAX_EXPOSURE)
        return true;
    return karst_fail(error, KARST_USAGE, "--exposure %.40s: must be auto, or stops from -%d to %d", look->exposure,
                      KARST_ENGINE_MAX_EXPOSURE, KARST_ENGINE_MAX_EXPOSURE);
}

void command_set_look(const command_look *look, karst_engine_config *config)
{
    config->samples = (uint32_t)look->samples;
    config->mirror = command_mirror(look->mirror, look->has_mirror);
    config->occlusion = command_occlusion(look->occlusion, look->no_occlusion);
    config->integrator = look->parsed_light;
    config->bounces = (uint32_t)look->bounces;
    config->caustics = (uint32_t)look->caustics;
    config->tone = look->parsed_tone;
    config->media = look->parsed_media;
    config->scattering = look->parsed_scattering;
    config->exposure = look->auto_exposure  ? KARST_EXPOSURE_OF_PICTURE
                       : look->has_exposure ? KARST_EXPOSURE_GIVEN
                                            : KARST_EXPOSURE_OF_WORLD;
    config->exposure_stops = look->exposure_stops;
    config->has_sun = look->sun != NULL;
    config->sun = look->parsed_sun;
}

karst_occlusion_mode command_occlusion(bool on, bool off)
{
    return off ? KARST_OCCLUSION_OFF : on ? KARST_OCCLUSION_ON : KARST_OCCLUSION_OF_WORLD;
}

/* Of 0 that was given: none, whatever the world says. */
double command_mirror(double share, bool given) { return !given ? 0 : share > 0 ? share : -1; }
