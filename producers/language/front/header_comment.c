#include "producers/language/front/header_comment.h"

#include <ctype.h>
#include <string.h>

/* Keys that no other comment is likely to have in front of a colon. */
static const char *const own_keys[] = {"seed",      "voxel",    "extent", "params", "camera", "sun",       "sky",
                                       "lipschitz", "exposure", "mirror", "lights", "models", "particles", "view",
                                       "occlusion", "light_map"};

static bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/* The text of the object in the first comment; false: there is none. */
static bool find_text(const karst_source *source, uint32_t *begin, uint32_t *end)
{
    const char *s = source->text;
    uint32_t i = source->user_begin, n = source->length;
    for (;;) { /* line comments may stand before it */
        while (i < n && is_blank(s[i]))
            i++;
        if (i + 1 >= n || s[i] != '/' || s[i + 1] != '/')
            break;
        while (i < n && s[i] != '\n')
            i++;
    }
    if (i + 1 >= n || s[i] != '/' || s[i + 1] != '*')
        return false;
    for (i += 2; i < n && (is_blank(s[i]) || s[i] == '*'); i++)
        ;
    if (i >= n || s[i] != '{')
        return false;
    *begin = i;
    for (*end = i; *end + 1 < n && !(s[*end] == '*' && s[*end + 1] == '/'); ++*end)
        ;
    return *end + 1 < n; /* a comment that never ends is the lexer's to report */
}

/* Blanks line comments, and commas before a closing bracket, so that places stay what they are. */
static void clean(char *text, uint32_t length)
{
    bool in_quotes = false;
    uint32_t comma = length; /* the last one, if only blanks followed it */
    for (uint32_t i = 0; i < length; i++) {
        if (in_quotes) {
            i += text[i] == '\\';
            in_quotes = i >= length || text[i] != '"';
            continue;
        }
        if (text[i] == '/' && i + 1 < length && text[i + 1] == '/')
            for (; i < length && text[i] != '\n'; i++)
                text[i] = ' ';
        if (i == length || is_blank(text[i]))
            continue;
        if ((text[i] == '}' || text[i] == ']') && comma < length)
            text[comma] = ' ';
        comma = text[i] == ',' ? i : length;
        in_quotes = text[i] == '"';
    }
}

/* Whether one of a header's own keys stands there before a colon, in quotes or not. */
static bool names_own_key(const char *text, uint32_t length)
{
    for (size_t k = 0; k < sizeof own_keys / sizeof *own_keys; k++) {
        const uint32_t n = (uint32_t)strlen(own_keys[k]);
        for (uint32_t i = 1; i + n < length; i++) {
            if (memcmp(text + i, own_keys[k], n) != 0 || isalnum((unsigned char)text[i - 1]) || text[i - 1] == '_')
                continue;
            uint32_t at = i + n + (text[i + n] == '"');
            while (at < length && is_blank(text[at]))
                at++;
            if (at < length && text[at] == ':')
                return true;
        }
    }
    return false;
}

/* { "name": ... */
static bool begins_as_json(const char *text, uint32_t length)
{
    uint32_t at = 1;
    while (at < length && is_blank(text[at]))
        at++;
    if (at == length || text[at] != '"')
        return at < length && text[at] == '[';
    for (at++; at < length && text[at] != '"' && text[at] != '\n'; at++)
        ;
    for (at++; at < length && is_blank(text[at]); at++)
        ;
    return at < length && text[at] == ':';
}

/* An object of something else: no key is a header's, nor like one. */
static bool is_foreign(const karst_source *source, json_t *root)
{
    const char *key;
    json_t *value;
    json_object_foreach(root, key, value)
    {
        karst_nearest nearest = karst_nearest_begin(key, strlen(key));
        for (const char *k = KARST_HEADER_KEYS; *k;) {
            const size_t n = strcspn(k, " ");
            char *name = karst_format(source->arena, "%.*s", (int)n, k);
            karst_nearest_offer(&nearest, name);
            k += n + (k[n] == ' ');
        }
        if (karst_nearest_hint(&nearest, source->arena))
            return false;
    }
    return json_object_size(root) > 0;
}

/* ISF's inputs that are floats with a usual value. */
static json_t *inputs_of(json_t *root)
{
    json_t *list = json_object_get(root, "INPUTS"), *item, *inputs = json_object();
    size_t i;
    json_array_foreach(list, i, item)
    {
        const char *name = json_string_value(json_object_get(item, "NAME"));
        const char *type = json_string_value(json_object_get(item, "TYPE"));
        json_t *usual = json_object_get(item, "DEFAULT"), *min = json_object_get(item, "MIN"),
               *max = json_object_get(item, "MAX");
        if (!name || !type || strcmp(type, "float") != 0)
            continue;
        const double value = json_number_value(usual);
        json_t *parameter = json_pack("{s:f}", "value", value);
        if (json_is_number(min) && json_is_number(max) && json_number_value(min) <= value &&
            value <= json_number_value(max)) {
            json_object_set(parameter, "min", min);
            json_object_set(parameter, "max", max);
        }
        json_object_set_new(inputs, name, parameter);
    }
    return inputs;
}

karst_header_object karst_header_find(karst_source *source)
{
    karst_header_object object = {0};
    if (!find_text(source, &object.begin, &object.end))
        return object;
    const uint32_t length = object.end - object.begin;
    char *text = karst_arena_alloc(source->arena, length + 1);
    memcpy(text, source->text + object.begin, length);
    clean(text, length);
    json_error_t e;
    json_t *root = json_loadb(text, length, JSON_REJECT_DUPLICATES, &e);
    /* A comment in a comment ends it too early, whatever it is. */
    if (!root && (begins_as_json(text, length) || names_own_key(text, length) || strstr(text, "/*"))) {
        const uint32_t where =
            object.begin + (e.position > 0 && (uint32_t)e.position <= length ? (uint32_t)e.position - 1 : 0);
        char *message = karst_format(source->arena, "the header is not JSON: %s", e.text);
        karst_source_error(source, where, "quote all names, put commas between, none at the end", "%s",
                           message);
    }
    if (root && is_foreign(source, root)) {
        object.inputs = inputs_of(root);
        json_decref(root);
        karst_source_warn(source, object.begin, "write /*{ \"voxel\": 0.125 }*/, say",
                          "this comment has no key of a header: it is passed over");
        return object;
    }
    object.root = root;
    return object;
}

bool karst_header_leaves_view(const json_t *root)
{
    static const char *const others[] = {"name",     "author", "description", "seed",      "params", "sun",
                                         "lipschitz", "sky",    "exposure",    "occlusion", "mirror"};
    size_t num = 0;
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        num += json_object_get(root, others[i]) != NULL;
    return num > 0 && num == json_object_size(root);
}
