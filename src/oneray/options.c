#include "options.h"

#include "kernel.h"
#include "message.h"
#include "version.h"

#include <ctype.h>
#include <errno.h>
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
    "usage: oneray SCENE.xml [-o OUT.exr] [-Dname=value ...] [options]\n"
    "       oneray merge PART.film ... -o OUT.exr\n"
    "\n"
    "Renders a scene (Mitsuba 3 XML) with the techniques of the lecture \"Probability Theory\", each\n"
    "selectable. All give the same picture on average and differ only in variance. Defaults: *.\n"
    "\n"
    "  -o OUT.exr             mean and standard error of each pixel (no error with --sampler sobol)\n"
    "  -Dname=value           sets a <default> of the scene\n"
    "  --spp N                samples per pixel, instead of the scene's sample_count\n"
    "  --time SECONDS         as many samples per pixel as the time allows, at least one\n"
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

static double positive(const char *option, const char *word)
{
    char *end;
    double value = strtod(word, &end);
    if (end == word || *end || !(value > 0 && value < 1e9))
        die("%s %s: a number of seconds above 0 is wanted", option, word);
    return value;
}

/* FIRST:COUNT */
static void range(Options *options, const char *word)
{
    char first[32];
    const char *colon = strchr(word, ':');
    if (!colon || colon - word >= (long)sizeof first)
        die("--samples %s: FIRST:COUNT is wanted, such as 0:64", word);
    memcpy(first, word, (size_t)(colon - word));
    first[colon - word] = 0;
    options->first_sample = whole("--samples FIRST", first, 0, (uint64_t)1 << 48);
    options->sample_count = whole("--samples COUNT", colon + 1, 1, (uint64_t)1 << 48);
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

/* An option that takes a word. */
static void with_word(Options *o, int given[CHOICES], const char *name, const char *word)
{
    for (int i = 0; i < CHOICES; i++)
        if (!strcmp(name, choices[i].name)) {
            given[i] = choose(&choices[i], word);
            return;
        }
    if (!strcmp(name, "-o"))
        o->output = word;
    else if (!strcmp(name, "--spp"))
        o->spp = whole(name, word, 1, (uint64_t)1 << 48);
    else if (!strcmp(name, "--time"))
        o->seconds = positive(name, word);
    else if (!strcmp(name, "--seed"))
        o->seed = whole(name, word, 0, UINT64_MAX);
    else if (!strcmp(name, "--samples"))
        range(o, word);
    else if (!strcmp(name, "--film"))
        o->film = word;
    else if (!strcmp(name, "--stats"))
        o->stats = word;
    else if (!strcmp(name, "--precision")
             && (!strcmp(word, "auto") || !strcmp(word, "double") || !strcmp(word, "single")))
        o->precision = word;
    else if (!strcmp(name, "--precision"))
        die("--precision %s is not supported (auto, double, single)", word);
    else if (!strcmp(name, "--kernel") && (!strcmp(word, "auto") || !strcmp(word, "generic")))
        o->generic = !strcmp(word, "generic");
    else if (!strcmp(name, "--kernel"))
        die("--kernel %s is not supported (auto, generic)", word);
    else
        o->lanes = strcmp(word, "auto") ? (int)whole(name, word, 1, 16) : 0;
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
    if ((o->sample_count != 0) != (o->film != NULL))
        die("--samples and --film go together: --samples FIRST:COUNT --film PART.film");
    if (o->sample_count && (o->spp || o->seconds > 0))
        die("--samples says which samples are rendered: --spp and --time do not go with it");
    if (o->film && o->output)
        die("--film writes a part; `oneray merge PART.film ... -o OUT.exr` makes the picture");
    if (!o->film && !o->output && !o->stats)
        die("nothing to do: give -o OUT.exr (or --stats - for the figures alone)");
    if (strcmp(o->precision, "auto"))
        options_kernel(o);
}

static void flag(Options *options, const char *word)
{
    if (!strcmp(word, "--quiet"))
        options->quiet = true;
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

static bool takes_word(const char *name)
{
    static const char *const names[] = {"-o", "--spp", "--time", "--seed", "--samples", "--film", "--stats",
        "--precision", "--kernel", "--lanes"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcmp(name, names[i]))
            return true;
    for (int i = 0; i < CHOICES; i++)
        if (!strcmp(name, choices[i].name))
            return true;
    return false;
}

Options options_read(int count, char **words)
{
    Options o = {0};
    int given[CHOICES];
    o.precision = "auto";
    for (int i = 0; i < CHOICES; i++)
        given[i] = -1;
    for (int i = 1; i < count; i++) {
        if (!takes_word(words[i])) {
            flag(&o, words[i]);
            continue;
        }
        if (i + 1 == count)
            die("%s: a value is wanted after it", words[i]);
        with_word(&o, given, words[i], words[i + 1]);
        i++;
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
        const Material *m = &scene->materials[i];
        for (int c = 0; c < 3; c++)
            if (m->kind != MATERIAL_BLEND && m->reflectance[c] >= 1 && !m->fresnel)
                return m;
    }
    return NULL;
}

void options_check(const Options *options, const Description *scene)
{
    static const char *const kinds[LIGHT_KINDS] = {"area", "point", "spot", "directional", "constant"};
    for (int i = 0; i < scene->light_count; i++) {
        const Light *light = &scene->lights[i];
        if (!light_has_power(light))
            warn("%s:%d: this light has no power and is left out", options->scene, light->line);
        if (options->technique.estimator == ESTIMATOR_WALK && light->kind != LIGHT_AREA
            && light->kind != LIGHT_CONSTANT)
            die_at(options->scene, light->line,
                "--estimator walk: no random ray hits a %s light, its light would be "
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
