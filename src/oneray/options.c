#include "options.h"

#include "kernel/kernel.h"
#include "message.h"
#include "film/picture.h"
#include "version.h"

#include <ctype.h>
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* An option that chooses one of several techniques: the first column of values is also the enum's order. */
typedef struct {
    const char *name, *help;
} Value;
typedef struct {
    const char *name, *help;
    int given;
    Value values[5];
} Choice;

enum {
    CHOICE_ESTIMATOR,
    CHOICE_HEMISPHERE,
    CHOICE_LIGHT,
    CHOICE_POINTS,
    CHOICE_MIS,
    CHOICE_MIS_PDF,
    CHOICE_ROULETTE,
    CHOICE_FRESNEL,
    CHOICE_SAMPLER,
    CHOICES
};

static const Choice choices[CHOICES] = {
    {"--estimator", "how light is found", ESTIMATOR_MIS,
        {{"walk", "L7 the random walk alone: light counts where a random ray hits it"},
            {"nee", "L10 next event estimation: a ray to a light at every vertex (L1 to L3, L11, L12)"},
            {"mis", "L13 both, weighed by multiple importance sampling"},
            {"light", "L17 light tracing: paths from the lights, each vertex joined to the eye"}}},
    {"--hemisphere", "one ray over the hemisphere", HEMISPHERE_COSINE,
        {{"uniform", "L8 uniform, scaled by 2 pi"}, {"cosine", "L9 in proportion to the cosine"}}},
    {"--light-choice", "one of N lights, divided by its probability (L4)", LIGHT_CHOICE_CONTRIBUTION,
        {{"uniform", "L4 each with 1/N; L6 situation 1, nothing known of occlusion"},
            {"power", "L4 in proportion to the flux (the default with --estimator light)"},
            {"contribution", "L6 by flux, distance and cosines; 0 where a light cannot contribute"},
            {"learned", "L18 that, and what a pre-pass saw of occlusion, L6 situation 2"}}},
    {"--light-points", "where on the light", LIGHT_POINTS_CONE,
        {{"area", "L2, L3 uniform on its area"},
            {"facing", "L5 the half of a sphere that faces the point, twice the density"},
            {"cone", "L5 the cone that a sphere fills; the solid angle of a rectangle"}}},
    {"--mis", "weights of --estimator mis", MIS_POWER,
        {{"balance", "L13 balance heuristic"}, {"power", "L13 power heuristic, exponent 2"}}},
    {"--mis-pdf", "density of the walk in them", MIS_PDF_BSDF,
        {{"bsdf", "L13 of the direction"},
            {"survival", "L13 of the direction and of surviving roulette, brdfPdf * Psurvive"}}},
    {"--roulette", "how a path ends", ROULETTE_SURVIVAL,
        {{"none", "L19 at max_depth only"},
            {"survival", "L14 from rr_depth on it survives with min(1, throughput)"}}},
    {"--fresnel", "reflectance of glass", FRESNEL_EXACT,
        {{"exact", "L15 Fresnel's"}, {"schlick", "L15 Schlick's approximation: another picture, a little wrong"}}},
    {"--sampler", "where the samples of a pixel lie; for pictures, not of the lecture", SAMPLER_INDEPENDENT,
        {{"independent", "by chance, what the lecture's variances and the standard errors are about"},
            {"sobol", "evenly (Owen-scrambled Sobol' points): less noise, no standard errors"}}},
};

static const char usage[] =
    "usage: oneray SCENE.xml [-o PICTURE] [-Dname=value ...] [options]\n"
    "       oneray merge PART.film ... -o PICTURE [--exposure STOPS]\n"
    "\n"
    "Renders a scene (Mitsuba 3 XML) with the techniques of the lecture \"Probability Theory\", each\n"
    "selectable. All give the same picture on average and differ only in variance. Defaults: *.\n"
    "\n"
    "  -o OUT.exr|.pfm|.png   mean of each pixel; in .exr also its standard error (not with --sampler sobol);\n"
    "                         .png in sRGB, 8 bits\n"
    "  --exposure STOPS       of .png: 2^STOPS times as bright\n"
    "  -Dname=value           sets a <default> of the scene\n"
    "  --width N, --height N  instead of the scene's; one alone keeps the image's shape\n"
    "  --crop X,Y,WIDTH,HEIGHT\n"
    "                         only these pixels, from the upper left; the same bits as in the whole image\n"
    "  --spp N                samples per pixel, instead of the scene's sample_count\n"
    "  --time SECONDS         as many samples per pixel as the time allows, at least one\n"
    "  --error RELATIVE       until the root mean square of the pixels' standard errors is RELATIVE of the\n"
    "                         image's mean (0.01 is 1 %); looks at 16, 18, 20 ... samples per pixel, by\n"
    "                         eighths; with --spp N or --time no longer than these say\n"
    "  --checkpoint FILE      keeps the film there, at least every --checkpoint-seconds N (60*), as long as\n"
    "                         one sample of every pixel takes less\n"
    "  --resume               goes on from the checkpoint, if there is one: the same bits as in one run\n"
    "  --seed S               0*; another seed gives other, independent samples\n";

static const char usage_end[] =
    "  --samples FIRST:COUNT  only these samples of each pixel, into --film PART.film; `oneray merge`\n"
    "                         joins the parts to the very picture that one run would have made\n"
    "  --precision auto*|double|single\n"
    "                         auto: single where the scene's sizes, gaps, lights and depth allow it\n"
    "  --lanes auto*|N        paths at once; the bits do not depend on it\n"
    "  --kernel auto*|generic specialised for what the scene has, or the general one; the same bits\n"
    "  --stats FILE|-         figures as JSON (- for standard output)\n"
    "  --quiet                no progress line\n"
    "  --version, --help\n"
    "\n"
    "exit status: 0 done, 2 the command line, the scene or a file was wrong (standard error says where)\n";

static void help(void)
{
    fputs(usage, stdout);
    for (int i = 0; i < CHOICES; i++) {
        printf("  %-22s %s\n", choices[i].name, choices[i].help);
        for (int v = 0; choices[i].values[v].name; v++)
            printf("      %-12s%c      %s\n", choices[i].values[v].name, v == choices[i].given ? '*' : ' ',
                choices[i].values[v].help);
    }
    fputs(usage_end, stdout);
    const char *last = "";
    fputs("\nkernels that run here:", stdout);
    for (int i = 0; kernel_built(i); i++)
        if (kernel_runs(kernel_built(i))) {
            const Kernel *kernel = kernel_built(i);
            if (strcmp(last, kernel->precision))
                printf("%s %s x %d", *last ? ";" : "", kernel->precision, kernel->lanes);
            else
                printf(", %d", kernel->lanes);
            last = kernel->precision;
        }
    putchar('\n');
}

static int choose(const Choice *choice, const char *word)
{
    char known[160] = "";
    for (int v = 0; choice->values[v].name; v++) {
        if (!strcmp(choice->values[v].name, word))
            return v;
        strcat(known, v ? ", " : "");
        strcat(known, choice->values[v].name);
    }
    die("%s %s is not supported (%s)", choice->name, word, known);
}

/* Is the word one of those in a list "a, b, c"? */
static bool is_one_of(const char *list, const char *word)
{
    size_t length = strlen(word);
    for (const char *at = list; at; at = strchr(at, ' '), at += at ? 1 : 0)
        if (!strncmp(at, word, length) && (at[length] == ',' || !at[length]) && length)
            return true;
    return false;
}

static uint64_t whole(const char *option, const char *word, uint64_t least, uint64_t most)
{
    char *end;
    errno = 0;
    unsigned long long value = strtoull(word, &end, 10);
    if (!isdigit((unsigned char)word[0]) || *end || errno || value < least || value > most)
        die("%s %s: a whole number from %llu to %llu is wanted", option, word, (unsigned long long)least,
            (unsigned long long)most);
    return value;
}

double options_real(const char *option, const char *word, double low, double high)
{
    char *end;
    double value = strtod(word, &end);
    if (end == word || *end || !(value > low && value < high))
        die("%s %s: a number between %g and %g is wanted", option, word, low, high);
    return value;
}

/* Whole numbers with `between` between them. */
static void numbers(const char *option, const char *word, const char *form, uint64_t *to, int count)
{
    const char *at = word;
    for (int i = 0; i < count; i++) {
        char *end;
        errno = 0;
        to[i] = strtoull(at, &end, 10);
        if (!isdigit((unsigned char)*at) || errno || to[i] > MOST_SAMPLES
            || *end != (i + 1 == count ? '\0' : count == 2 ? ':' : ','))
            die("%s %s: %s is wanted", option, word, form);
        at = end + 1;
    }
}

static void parameter(Options *options, const char *word)
{
    char *copy = allocate(strlen(word) + 1, 1);
    strcpy(copy, word);
    char *equals = strchr(copy, '=');
    if (!equals || equals == copy)
        die("-D%s: -Dname=value is wanted", word);
    *equals = 0;
    for (int i = 0; i < options->parameter_count; i++)
        if (!strcmp(options->parameters[i].name, copy))
            die("-D%s is given twice", copy);
    if (options->parameter_count == MAX_PARAMETERS)
        die("more than %d -D parameters", MAX_PARAMETERS);
    options->parameters[options->parameter_count++] = (Parameter){copy, equals + 1, false};
}

/* An option that takes a word, and where it goes. */
typedef struct {
    const char *name;
    enum { TEXT, WORD, WHOLE, POSITIVE, STOPS, RANGE, CROP, WIDTH } kind;
    size_t at;            /* in Options */
    uint64_t least, most; /* of WHOLE */
    const char *words;    /* the WORDs that are supported */
} Plain;
#define AT(field) offsetof(Options, field)
static const Plain plain[] = {
    {"-o", TEXT, AT(output), 0, 0, NULL},
    {"--film", TEXT, AT(film), 0, 0, NULL},
    {"--stats", TEXT, AT(stats), 0, 0, NULL},
    {"--checkpoint", TEXT, AT(checkpoint), 0, 0, NULL},
    {"--precision", WORD, AT(precision), 0, 0, "auto, double, single"},
    {"--kernel", WORD, AT(kernel), 0, 0, "auto, generic"},
    {"--spp", WHOLE, AT(spp), 1, MOST_SAMPLES, NULL},
    {"--seed", WHOLE, AT(seed), 0, UINT64_MAX, NULL},
    {"--width", WHOLE, AT(size[0]), 1, 65536, NULL},
    {"--height", WHOLE, AT(size[1]), 1, 65536, NULL},
    {"--time", POSITIVE, AT(seconds), 0, 0, NULL},
    {"--error", POSITIVE, AT(error), 0, 0, NULL},
    {"--checkpoint-seconds", POSITIVE, AT(checkpoint_seconds), 0, 0, NULL},
    {"--exposure", STOPS, AT(exposure), 0, 0, NULL},
    {"--samples", RANGE, AT(first_sample), 0, 0, NULL},
    {"--crop", CROP, AT(crop), 0, 0, NULL},
    {"--lanes", WIDTH, AT(lanes), 0, 0, NULL},
};

static const Plain *plain_option(const char *name)
{
    for (size_t i = 0; i < sizeof plain / sizeof *plain; i++)
        if (!strcmp(name, plain[i].name))
            return &plain[i];
    return NULL;
}

static void with_word(Options *o, const Plain *option, const char *word)
{
    void *at = (char *)o + option->at;
    switch (option->kind) {
    case WORD:
        if (!is_one_of(option->words, word))
            die("%s %s is not supported (%s)", option->name, word, option->words);
        *(const char **)at = word;
        break;
    case TEXT: *(const char **)at = word; break;
    case WHOLE: *(uint64_t *)at = whole(option->name, word, option->least, option->most); break;
    case POSITIVE: *(double *)at = options_real(option->name, word, 0, 1e9); break;
    case STOPS: *(double *)at = options_real(option->name, word, -128, 128); break;
    case RANGE:
        numbers(option->name, word, "FIRST:COUNT", at, 2);
        if (!o->sample_count)
            die("--samples %s: COUNT is 1 at least", word);
        break;
    case CROP:
        numbers(option->name, word, "X,Y,WIDTH,HEIGHT", at, 4);
        if (!o->crop[2] || !o->crop[3])
            die("--crop %s: WIDTH and HEIGHT are 1 at least", word);
        break;
    case WIDTH: *(int *)at = strcmp(word, "auto") ? (int)whole("--lanes", word, 1, 16) : 0; break;
    }
}

/* Options of a technique that the estimator has no use for. */
static void check_technique(const Technique *t, const int given[CHOICES])
{
    if ((given[CHOICE_MIS] >= 0 || given[CHOICE_MIS_PDF] >= 0) && t->estimator != ESTIMATOR_MIS)
        die("%s weighs two ways to find a light: it goes with --estimator mis only",
            choices[given[CHOICE_MIS] >= 0 ? CHOICE_MIS : CHOICE_MIS_PDF].name);
    if (t->estimator == ESTIMATOR_WALK && (given[CHOICE_LIGHT] >= 0 || given[CHOICE_POINTS] >= 0))
        die("--estimator walk sends no ray to a light: %s does nothing there",
            choices[given[CHOICE_LIGHT] >= 0 ? CHOICE_LIGHT : CHOICE_POINTS].name);
    if (t->estimator == ESTIMATOR_LIGHT && given[CHOICE_POINTS] >= 0)
        die("--estimator light starts anywhere on a light: --light-points does nothing there");
    if (t->estimator == ESTIMATOR_LIGHT && given[CHOICE_LIGHT] >= LIGHT_CHOICE_CONTRIBUTION)
        die("--estimator light chooses a light before it knows where it shines: --light-choice uniform or power");
    if (t->mis_pdf == MIS_PDF_SURVIVAL && t->roulette == ROULETTE_NONE)
        die("--mis-pdf survival: with --roulette none every path survives");
}

const Kernel *options_kernel(const Options *o)
{
    const Kernel *kernel = kernel_find(o->precision, o->lanes);
    if (!kernel)
        die("--lanes %d --precision %s: this build or this processor has no such kernel (--help lists them)",
            o->lanes, o->precision);
    return kernel;
}

/* What can be seen to make no sense before the scene is read. `given` is -1 for an option that was not. */
static void check_given(Options *o, const int given[CHOICES])
{
    if (!o->scene)
        die("a scene is wanted: oneray SCENE.xml -o OUT.exr (--help tells more)");
    check_technique(&o->technique, given);
    if (o->spp && o->seconds > 0)
        die("--spp and --time: give one of them");
    if (o->error > 0 && o->technique.sampler == SAMPLER_SOBOL)
        die("--error wants the standard errors of independent samples: not with --sampler sobol");
    if ((o->sample_count != 0) != (o->film != NULL))
        die("--samples and --film go together: --samples FIRST:COUNT --film PART.film");
    if (o->sample_count && (o->spp || o->seconds > 0 || o->error > 0))
        die("--samples says which samples are rendered: --spp, --time and --error do not go with it");
    if (o->film && o->output)
        die("--film writes a part; `oneray merge PART.film ... -o OUT.exr` makes the picture");
    if (!o->film && !o->output && !o->stats)
        die("nothing to do: give -o OUT.exr (or --stats - for the figures alone)");
    if (!o->checkpoint && (o->resume || o->checkpoint_seconds > 0))
        die("%s: --checkpoint FILE is wanted with it", o->resume ? "--resume" : "--checkpoint-seconds");
    if (o->output)
        picture_check_name(o->output, o->exposure);
    if (o->checkpoint_seconds <= 0)
        o->checkpoint_seconds = 60;
    if (strcmp(o->precision, "auto"))
        options_kernel(o);
}

static void flag(Options *options, const char *word)
{
    if (!strcmp(word, "--quiet"))
        options->quiet = true;
    else if (!strcmp(word, "--resume"))
        options->resume = true;
    else if (!strcmp(word, "--help") || !strcmp(word, "-h"))
        help(), exit(0);
    else if (!strcmp(word, "--version"))
        printf("oneray %s\n", ONERAY_VERSION), exit(0);
    else if (!strncmp(word, "-D", 2))
        parameter(options, word + 2);
    else if (word[0] == '-')
        die("%s is no option (--help lists them)", word);
    else if (options->scene)
        die("%s and %s: one scene is wanted", options->scene, word);
    else
        options->scene = word;
}

static int choice_option(const char *name)
{
    int i = 0;
    while (i < CHOICES && strcmp(name, choices[i].name))
        i++;
    return i;
}

Options options_read(int count, char **words)
{
    Options o = {0};
    int given[CHOICES];
    o.precision = o.kernel = "auto";
    for (int i = 0; i < CHOICES; i++)
        given[i] = -1;
    for (int i = 1; i < count; i++) {
        const Plain *option = plain_option(words[i]);
        int choice = choice_option(words[i]);
        if (!option && choice == CHOICES) {
            flag(&o, words[i]);
            continue;
        }
        if (++i == count)
            die("%s: a value is wanted after it", words[i - 1]);
        if (option)
            with_word(&o, option, words[i]);
        else
            given[choice] = choose(&choices[choice], words[i]);
    }
    int value[CHOICES];
    for (int i = 0; i < CHOICES; i++)
        value[i] = given[i] < 0 ? choices[i].given : given[i];
    if (value[CHOICE_ESTIMATOR] == ESTIMATOR_LIGHT && given[CHOICE_LIGHT] < 0)
        value[CHOICE_LIGHT] = LIGHT_CHOICE_POWER;
    o.technique = (Technique){(Estimator)value[CHOICE_ESTIMATOR], (Hemisphere)value[CHOICE_HEMISPHERE],
        (LightChoice)value[CHOICE_LIGHT], (LightPoints)value[CHOICE_POINTS], (MisHeuristic)value[CHOICE_MIS],
        (MisPdf)value[CHOICE_MIS_PDF], (Roulette)value[CHOICE_ROULETTE], (Fresnel)value[CHOICE_FRESNEL],
        (Sampler)value[CHOICE_SAMPLER]};
    check_given(&o, given);
    return o;
}

/* L17 light tracing: what it cannot render, as far as the scene says so. */
static void check_light_paths(const Options *options, const Description *scene)
{
    if (options->technique.estimator == ESTIMATOR_LIGHT && scene->hide_emitters)
        die("%s: hide_emitters is not supported with --estimator light", options->scene);
}

/* Would a path in a closed scene never be cut short? Only where a material absorbs nothing. */
static const Material *absorbs_nothing(const Description *scene)
{
    for (int i = 0; i < scene->material_count; i++) {
        MaterialTraits traits = material_traits(&scene->materials[i]);
        for (int c = 0; c < 3 && traits.reflected; c++)
            if (traits.reflected[c] >= 1 && !traits.absorbs)
                return &scene->materials[i];
    }
    return NULL;
}

void options_check(const Options *options, const Description *scene)
{
    const Sensor *sensor = &scene->sensor;
    const uint64_t *crop = options->crop, width = (uint64_t)sensor->width, height = (uint64_t)sensor->height;
    if (crop[2] > width || crop[0] > width - crop[2] || crop[3] > height || crop[1] > height - crop[3])
        die("--crop: the image has %d x %d pixels", sensor->width, sensor->height);
#define X(NAME, name, words) words,
    static const char *const kinds[EMITTER_KINDS] = {EMITTERS(X)};
#undef X
    for (int i = 0; i < scene->emitter_count; i++) {
        const Emitter *light = &scene->emitters[i];
        if (!emitter_has_power(light))
            warn("%s:%d: this light has no power and is left out", options->scene, light->line);
        LightFrom from = emitter_traits(light).from;
        if (options->technique.estimator == ESTIMATOR_WALK && (from == FROM_POINT || from == FROM_AFAR))
            die_at(options->scene, light->line,
                "--estimator walk: no random ray hits a %s, its light would be "
                "missing; use nee or mis",
                kinds[light->kind]);
    }
    check_light_paths(options, scene);
    if (scene->max_depth < 0 && options->technique.roulette == ROULETTE_NONE)
        die("--roulette none: %s has max_depth -1, its paths would never end", options->scene);
    const Material *endless = scene->max_depth < 0 ? absorbs_nothing(scene) : NULL;
    if (endless)
        warn("%s:%d: this material absorbs nothing and max_depth is -1: a path that cannot leave will be an "
             "error",
            options->scene, endless->line);
}

/* Does this choice change anything with this estimator? */
static bool says_something(int choice, Estimator estimator)
{
    switch (choice) {
    case CHOICE_MIS:
    case CHOICE_MIS_PDF: return estimator == ESTIMATOR_MIS;
    case CHOICE_LIGHT: return estimator != ESTIMATOR_WALK;
    case CHOICE_POINTS: return estimator == ESTIMATOR_NEE || estimator == ESTIMATOR_MIS;
    default: return true;
    }
}

void options_technique(const Technique *t, char *text, int size)
{
    const int value[CHOICES] = {(int)t->estimator, (int)t->hemisphere, (int)t->light_choice,
        (int)t->light_points, (int)t->mis, (int)t->mis_pdf, (int)t->roulette, (int)t->fresnel,
        (int)t->sampler};
    for (int i = 0, used = 0; i < CHOICES; i++)
        if (says_something(i, t->estimator))
            used += snprintf(text + used, (size_t)(size - used), "%s%s %s", used ? " " : "", choices[i].name,
                choices[i].values[value[i]].name);
}
