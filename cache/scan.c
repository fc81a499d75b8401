/* The host's look through stamps: bits for each vector's stamps, by its width, and what is done with them. */
#include "cache/scan.h"

#include <stdbool.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define HAS_WIDTHS
#endif

#define WORD KARST_SCAN_WORD
/* Looked at together, while they are in the first cache. */
#define BLOCK_WORDS 32u
#define LINE 16u /* of memory has so many stamps */
/* Memory is asked for so many stamps ahead: processors do that by themselves, but not past the end of a page. */
#define AHEAD 2048u

K_INLINE void expect_word(const uint32_t *stamps)
{
    for (uint32_t i = 0; i < WORD; i += LINE)
        __builtin_prefetch(stamps + AHEAD + i);
}

/* ---- whatever processor ---- */

static void equal_plain(const uint32_t *stamps, uint32_t num, uint32_t serial, uint64_t *words)
{
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < WORD; i++)
            word |= (uint64_t)(stamps[i] == serial) << i;
        *words++ = word;
    }
}

static void old_plain(const uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t age, uint64_t *words)
{
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < WORD; i++)
            word |= (uint64_t)(karst_survey_age(stamps[i], serial) >= age) << i;
        *words++ = word;
    }
}

static uint32_t count_plain(const uint64_t *words, uint32_t num)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < num; i++)
        sum += (uint32_t)__builtin_popcountll(words[i]);
    return sum;
}

static const karst_scan scan_plain = {equal_plain, old_plain, count_plain};

#ifdef HAS_WIDTHS

/* ---- SSE2, which all x86-64 have ---- */

/* Sixteen masks of 32 bits as bits. */
#define BITS_SSE2(a, b, c, d) \
    (uint64_t)(uint32_t)_mm_movemask_epi8(_mm_packs_epi16(_mm_packs_epi32(a, b), _mm_packs_epi32(c, d)))

static inline __m128i load_sse2(const uint32_t *stamps) { return _mm_loadu_si128((const __m128i *)stamps); }

static void equal_sse2(const uint32_t *stamps, uint32_t num, uint32_t serial, uint64_t *words)
{
    const __m128i is = _mm_set1_epi32((int)serial);
#define EQUAL(j) _mm_cmpeq_epi32(load_sse2(stamps + i + (j)), is)
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        expect_word(stamps);
        for (uint32_t i = 0; i < WORD; i += 16)
            word |= BITS_SSE2(EQUAL(0), EQUAL(4), EQUAL(8), EQUAL(12)) << i;
        *words++ = word;
    }
#undef EQUAL
}

static inline __m128i is_old_sse2(__m128i x, __m128i now, __m128i below)
{
    return _mm_or_si128(_mm_cmpgt_epi32(_mm_sub_epi32(now, x), below), _mm_cmpeq_epi32(x, _mm_setzero_si128()));
}

static void old_sse2(const uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t age, uint64_t *words)
{
    /* Unsigned numbers compare like signed ones with the sign turned over. */
    const __m128i now = _mm_set1_epi32((int)(serial ^ 0x80000000u));
    const __m128i below = _mm_set1_epi32((int)((age - 1) ^ 0x80000000u));
#define OLD(j) is_old_sse2(load_sse2(stamps + i + (j)), now, below)
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < WORD; i += 16)
            word |= BITS_SSE2(OLD(0), OLD(4), OLD(8), OLD(12)) << i;
        *words++ = word;
    }
#undef OLD
}

static const karst_scan scan_sse2 = {equal_sse2, old_sse2, count_plain};

/* ---- AVX2 ---- */

#define AVX2 __attribute__((target("popcnt,avx2")))

/* Eight masks of 32 bits as bits. */
#define BITS_AVX2(mask) (uint64_t)(uint32_t)_mm256_movemask_ps(_mm256_castsi256_ps(mask))

AVX2 static inline __m256i load_avx2(const uint32_t *stamps) { return _mm256_loadu_si256((const __m256i *)stamps); }

AVX2 static void equal_avx2(const uint32_t *stamps, uint32_t num, uint32_t serial, uint64_t *words)
{
    const __m256i is = _mm256_set1_epi32((int)serial);
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        expect_word(stamps);
        for (uint32_t i = 0; i < WORD; i += 8)
            word |= BITS_AVX2(_mm256_cmpeq_epi32(load_avx2(stamps + i), is)) << i;
        *words++ = word;
    }
}

AVX2 static inline __m256i is_old_avx2(__m256i x, __m256i now, __m256i least)
{
    __m256i age = _mm256_sub_epi32(now, x);
    return _mm256_or_si256(_mm256_cmpeq_epi32(_mm256_max_epu32(age, least), age),
                           _mm256_cmpeq_epi32(x, _mm256_setzero_si256()));
}

AVX2 static void old_avx2(const uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t age, uint64_t *words)
{
    const __m256i now = _mm256_set1_epi32((int)serial), least = _mm256_set1_epi32((int)age);
    for (; num > 0; num--, stamps += WORD) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < WORD; i += 8)
            word |= BITS_AVX2(is_old_avx2(load_avx2(stamps + i), now, least)) << i;
        *words++ = word;
    }
}

AVX2 static uint32_t count_avx2(const uint64_t *words, uint32_t num)
{
    uint32_t sum = 0;
    for (uint32_t i = 0; i < num; i++)
        sum += (uint32_t)__builtin_popcountll(words[i]);
    return sum;
}

static const karst_scan scan_avx2 = {equal_avx2, old_avx2, count_avx2};

/* ---- AVX-512 ---- */

#define AVX512 __attribute__((target("popcnt,avx512f")))

AVX512 static void equal_avx512(const uint32_t *stamps, uint32_t num, uint32_t serial, uint64_t *words)
{
    const __m512i is = _mm512_set1_epi32((int)serial);
#define EQUAL(j) ((uint64_t)_mm512_cmpeq_epi32_mask(_mm512_loadu_si512(stamps + (j)), is) << (j))
    for (; num > 0; num--, stamps += WORD) {
        expect_word(stamps);
        *words++ = EQUAL(0) | EQUAL(16) | EQUAL(32) | EQUAL(48);
    }
#undef EQUAL
}

AVX512 static void old_avx512(const uint32_t *stamps, uint32_t num, uint32_t serial, uint32_t age, uint64_t *words)
{
    const __m512i now = _mm512_set1_epi32((int)serial), least = _mm512_set1_epi32((int)age);
#define STAMPS(j) _mm512_loadu_si512(stamps + (j))
#define OLD(j)                                                                            \
    ((uint64_t)(_mm512_cmpge_epu32_mask(_mm512_sub_epi32(now, STAMPS(j)), least) | \
                _mm512_testn_epi32_mask(STAMPS(j), STAMPS(j)))                            \
     << (j))
    for (; num > 0; num--, stamps += WORD)
        *words++ = OLD(0) | OLD(16) | OLD(32) | OLD(48);
#undef OLD
#undef STAMPS
}

static const karst_scan scan_avx512 = {equal_avx512, old_avx512, count_avx2};

#endif

/* ---- which ---- */

const karst_scan *karst_scan_of_width(int width)
{
#ifdef HAS_WIDTHS
    __builtin_cpu_init();
    bool has_count = __builtin_cpu_supports("popcnt");
    if (width == 3)
        return has_count && __builtin_cpu_supports("avx512f") ? &scan_avx512 : NULL;
    if (width == 2)
        return has_count && __builtin_cpu_supports("avx2") ? &scan_avx2 : NULL;
    if (width == 1)
        return &scan_sse2;
#endif
    return width == 0 ? &scan_plain : NULL;
}

const karst_scan *karst_scan_best(void)
{
    const karst_scan *scan = NULL;
    for (int width = KARST_SCAN_WIDTHS - 1; !scan; width--)
        scan = karst_scan_of_width(width);
    return scan;
}

/* ---- what is found ---- */

/* A look at slots of one kind. */
typedef struct {
    const karst_scan *scan;
    const karst_survey_ask *ask;
    bool two;       /* stamps a slot */
    bool stand_ins; /* are looked for */
    bool has_exact; /* there is a stamp that is exactly of the age */
    uint32_t kind, num_used, num_exact, num;
    karst_survey_slot *slots;
} look;

/* Of the slots that `fits` names, those that are exactly of the age; stand-ins are all alike. */
static uint64_t exact_of(const look *l, const uint32_t *a, const uint32_t *b, uint64_t fits)
{
    uint64_t exact = 0, more = 0;
    if (l->stand_ins)
        return fits;
    if (!l->has_exact)
        return 0;
    l->scan->equal(a, 1, l->ask->serial - l->ask->ages[l->kind], &exact);
    if (l->two)
        l->scan->equal(b, 1, l->ask->serial - l->ask->ages[l->kind], &more);
    return (exact | more) & fits;
}

/* Of the slots from `first` on, with these stamps, those that `fits` names; of the ones that are exactly of the age the
 * first ask->most in all. */
static void list_word(look *l, const uint32_t *a, const uint32_t *b, uint32_t first, uint64_t fits)
{
    const uint32_t most = l->ask->most[l->kind], serial = l->ask->serial, age = l->ask->ages[l->kind];
    karst_survey_slot *slots = l->slots;
    uint32_t num = l->num, num_exact = l->num_exact;
    if (num_exact >= most) { /* none of them any more: often they are nearly all */
        uint64_t exact = exact_of(l, a, b, fits);
        num_exact += l->scan->count(&exact, 1);
        fits &= ~exact;
    }
    for (; fits; fits &= fits - 1) {
        uint32_t i = (uint32_t)__builtin_ctzll(fits);
        uint32_t x = karst_survey_age(a[i], serial), y = karst_survey_age(b[i], serial), least = x < y ? x : y;
        bool exact = l->stand_ins || (l->has_exact && least == age);
        slots[num] = (karst_survey_slot){first + i, least};
        num += !exact || num_exact < most;
        num_exact += exact;
    }
    l->num = num;
    l->num_exact = num_exact;
}

/* `there`: the bits of the last word that are slots. */
static void look_at_block(look *l, const uint32_t *a, const uint32_t *b, uint32_t first, uint32_t num, uint64_t there)
{
    const uint32_t serial = l->ask->serial, age = l->ask->ages[l->kind];
    uint64_t used[BLOCK_WORDS], fits[BLOCK_WORDS], more[BLOCK_WORDS];
    l->scan->equal(a, num, serial, used);
    used[num - 1] &= there;
    if (l->stand_ins)
        memcpy(fits, used, num * sizeof(*fits));
    else if (age)
        l->scan->old(a, num, serial, age, fits);
    if (l->two) {
        l->scan->equal(b, num, serial, more);
        more[num - 1] &= there;
        for (uint32_t i = 0; i < num; i++)
            used[i] |= more[i];
        if (age && !l->stand_ins) {
            l->scan->old(b, num, serial, age, more);
            for (uint32_t i = 0; i < num; i++)
                fits[i] &= more[i];
        }
    }
    l->num_used += l->scan->count(used, num);
    if (age == 0)
        return;
    fits[num - 1] &= there;
    for (uint32_t i = 0; i < num; i++) {
        uint64_t word = l->stand_ins ? used[i] & ~fits[i] : fits[i];
        if (word)
            list_word(l, a + i * WORD, b + i * WORD, first + i * WORD, word);
    }
}

karst_scan_counts karst_scan_slots(const karst_scan *scan, const uint32_t *a, const uint32_t *b,
                                   const karst_survey_ask *ask, uint32_t kind, karst_survey_slot *slots)
{
    const uint32_t num = ask->num[kind], most = ask->most[kind];
    look l = {.scan = scan,
              .ask = ask,
              .two = kind == KARST_SURVEY_BRICKS,
              .stand_ins = kind == KARST_SURVEY_BRICKS && ask->stand_ins,
              /* Never (0) is of no age, and neither is what is as old as that. */
              .has_exact = ask->ages[kind] != UINT32_MAX && ask->serial != ask->ages[kind],
              .kind = kind,
              .slots = slots};
    uint32_t first = 0;
    while (num - first >= WORD) {
        uint32_t words = (num - first) / WORD;
        words = words < BLOCK_WORDS ? words : BLOCK_WORDS;
        look_at_block(&l, a + first, b + first, first, words, UINT64_MAX);
        first += words * WORD;
    }
    if (first < num) {
        uint32_t last[2][WORD] = {{0}}, left = num - first;
        memcpy(last[0], a + first, left * sizeof(*a));
        memcpy(last[1], b + first, left * sizeof(*b));
        look_at_block(&l, last[0], last[1], first, 1, ((uint64_t)1 << left) - 1);
    }
    return (karst_scan_counts){l.num_used, l.num, l.num_exact > most ? l.num_exact - most : 0};
}

uint32_t karst_scan_list(const karst_scan *scan, const uint32_t *stamps, uint32_t num, uint32_t serial,
                         uint32_t *listed)
{
    uint32_t num_listed = 0, first = 0;
    while (num - first >= WORD) {
        uint64_t words[BLOCK_WORDS];
        uint32_t num_words = (num - first) / WORD;
        num_words = num_words < BLOCK_WORDS ? num_words : BLOCK_WORDS;
        scan->equal(stamps + first, num_words, serial, words);
        for (uint32_t i = 0; i < num_words; i++, first += WORD)
            for (uint64_t left = words[i]; left; left &= left - 1)
                listed[num_listed++] = first + (uint32_t)__builtin_ctzll(left);
    }
    for (; first < num; first++)
        if (stamps[first] == serial)
            listed[num_listed++] = first;
    return num_listed;
}
