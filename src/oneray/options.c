#include "options.h"

#include "film/picture.h"
#include "kernel/kernel.h"
#include "message.h"
#include "version.h"

#include <ctype.h>
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A word that an option takes. */
typedef struct {
    const char *word, *help;
} Value;

typedef struct {
    const char *name, *argument; /* the argument as --help calls it; NULL: none, or one of the values */
    enum {
        TEXT,      /* const char *: any word */
        WORD,      /* const char *: one of the values */
        CHOICE,    /* int of the technique: which of the values */
        WHOLE,     /* uint64_t from least to most, or 0 for the first of the values */
        REAL,      /* double between low and high */
        RANGE,     /* first_sample and sample_count */
        CROP,      /* uint64_t[4] */
        STRATEGY,  /* uint64_t[2] */
        FLAG,      /* bool, without a word */
        PARAMETER, /* the word follows without a space */
        HELP,
        VERSION
    } kind;
    size_t at; /* in Options */
    const char *help;
    uint64_t least, most;
    double low, high;
    const Value *values; /* up to one without a word */
    int unasked;         /* CHOICE, WORD: the value of an option that is not given */
    int estimators;      /* CHOICE: those it means something to, a bit each; 0: all */
    bool merges;         /* `oneray merge` takes it, too */
} Option;

#define AT(field) offsetof(Options, field)
#define TECHNIQUE(field) CHOICE, AT(technique.field)
#define ROW(name, word, help) {word, help},
#define OF(LIST) .values = (const Value[]){LIST(ROW){NULL, NULL}}
#define WITH(estimator) 1 << ESTIMATOR_##estimator

/* Every option, as --help lists them. */
static const Option table[] = {
    {"-o", "PICTURE", TEXT, AT(output), .merges = true,
        .help = ".exr, .pfm or .png: mean of each pixel; in .exr also its standard error (not with\n"
                "--sampler sobol); .png in sRGB, 8 bits"},
    {"--exposure", "STOPS", REAL, AT(exposure), .low = -128, .high = 128, .merges = true,
        .help = "of .png and --show: 2^STOPS times as bright"},
    {"--png", "FILE.png", TEXT, AT(png), .help = "also this picture, beside an .exr that holds the radiance"},
    {"--show", NULL, FLAG, AT(show), .help = "shows the picture in the terminal, of COLUMNS characters or 80"},
    {"-D", "name=value", PARAMETER, 0, .help = "sets a <default> of the scene"},
    {"--sensor", "ID|N", TEXT, AT(sensor), .help = "the scene's sensor with this id, or its N-th, from 0 on"},
    {"--check", NULL, FLAG, AT(check),
        .help = "reads the scene and says all that is wrong with it; renders nothing"},
    {"--preview", NULL, FLAG, AT(preview),
        .help = "--width 256 --time 1, where none of --width, --height, --time and --spp is given"},
    {"--width", "N", WHOLE, AT(size[0]), .least = 1, .most = 65536,
        .help = "instead of the scene's; one alone keeps the image's shape"},
    {"--height", "N", WHOLE, AT(size[1]), .least = 1, .most = 65536, .help = "likewise"},
    {"--crop", "X,Y,WIDTH,HEIGHT", CROP, AT(crop),
        .help = "only these pixels, from the upper left; the same bits as in the whole image"},
    {"--spp", "N", WHOLE, AT(spp), .least = 1, .most = MOST_SAMPLES,
        .help = "samples per pixel, instead of the scene's sample_count"},
    {"--time", "SECONDS", REAL, AT(seconds), .high = 1e9,
        .help = "as many samples per pixel as the time allows, at least one"},
    {"--error", "RELATIVE", REAL, AT(error), .high = 1e9,
        .help = "until the root mean square of the pixels' standard errors is RELATIVE of the\n"
                "image's mean (0.01 is 1 %); looks at 16, 18, 20 ... samples per pixel, by\n"
                "eighths; with --spp N or --time no longer than these say"},
    {"--checkpoint", "FILE", TEXT, AT(checkpoint), .help = "keeps the film there, again and again"},
    {"--checkpoint-seconds", "N", REAL, AT(checkpoint_seconds), .high = 1e9,
        .help = "60*; at least so often, as long as one sample of every pixel takes less"},
    {"--resume", NULL, FLAG, AT(resume),
        .help = "goes on from the checkpoint, if there is one: the same bits as in one run"},
    {"--seed", "S", WHOLE, AT(seed), .most = UINT64_MAX,
        .help = "0*; another seed gives other, independent samples"},

    {"--estimator", NULL, TECHNIQUE(estimator), .unasked = ESTIMATOR_MIS, OF(ESTIMATORS),
        .help = "how light is found"},
    {"--hemisphere", NULL, TECHNIQUE(hemisphere), .unasked = HEMISPHERE_COSINE, OF(HEMISPHERES),
        .help = "one ray over the hemisphere"},
    {"--normals", NULL, TECHNIQUE(normals), .unasked = NORMALS_VISIBLE, OF(NORMALS),
        .help = "of a rough surface's microfacets, with --hemisphere cosine"},
    {"--light-choice", NULL, TECHNIQUE(light_choice), .unasked = LIGHT_CHOICE_CONTRIBUTION, OF(LIGHT_CHOICES),
        .estimators = WITH(NEE) | WITH(MIS) | WITH(LIGHT) | WITH(BIDIRECTIONAL) | WITH(PHOTONS),
        .help = "one of N lights, divided by its probability (L4)"},
    {"--candidates", "M", WHOLE, AT(technique.candidates), .least = 1, .most = MOST_CANDIDATES,
        .help = "4*; of --light-choice resampled, from 1 to 64: samples to one visibility ray"},
    {"--light-points", NULL, TECHNIQUE(light_points), .unasked = LIGHT_POINTS_CONE, OF(POINTS_ON_LIGHTS),
        .estimators = WITH(NEE) | WITH(MIS) | WITH(BIDIRECTIONAL), .help = "where on the light"},
    {"--mis", NULL, TECHNIQUE(mis), .unasked = MIS_POWER, OF(MIS_HEURISTICS),
        .estimators = WITH(MIS) | WITH(BIDIRECTIONAL), .help = "weights of --estimator mis and bidirectional"},
    {"--mis-pdf", NULL, TECHNIQUE(mis_pdf), .unasked = MIS_PDF_BSDF, OF(MIS_PDFS), .estimators = WITH(MIS),
        .help = "density of the walk in them"},
    {"--strategy", "S,T", STRATEGY, AT(technique.strategy),
        .help = "of --estimator bidirectional only this one, unweighted: S vertices from the light,\n"
                "T from the eye"},
    {"--radius", "METRES", REAL, AT(technique.radius), .high = 1e30, .estimators = WITH(PHOTONS),
        .help = "of --estimator photons in the first sample, 0.01 of the scene's half diagonal*; it\n"
                "shrinks from sample to sample"},
    {"--photons", "N", WHOLE, AT(technique.photons), .least = 1, .most = MOST_PHOTONS,
        .estimators = WITH(PHOTONS),
        .help = "of --estimator photons light paths in a sample; one for each pixel*"},
    {"--roulette", NULL, TECHNIQUE(roulette), .unasked = ROULETTE_SURVIVAL, OF(ROULETTES),
        .help = "how a path ends"},
    {"--fresnel", NULL, TECHNIQUE(fresnel), .unasked = FRESNEL_EXACT, OF(FRESNELS),
        .help = "reflectance of glass"},
    {"--sampler", NULL, TECHNIQUE(sampler), .unasked = SAMPLER_INDEPENDENT, OF(SAMPLERS),
        .help = "where the samples of a pixel lie; for pictures, not of the lecture"},

    {"--samples", "FIRST:COUNT", RANGE, 0,
        .help = "only these samples of each pixel, into --film PART.film; `oneray merge`\n"
                "joins the parts to the very picture that one run would have made"},
    {"--film", "PART.film", TEXT, AT(film), .help = "where they go"},
    {"--precision", NULL, WORD, AT(precision), .help = "of the arithmetic",
        .values = (const Value[]){{"auto", "single where the scene's sizes, gaps, lights and depth allow it"},
            {"double", "of 64 bits"}, {"single", "of 32 bits, for twice as many lanes"}, {NULL, NULL}}},
    {"--lanes", "N", WHOLE, AT(lanes), .least = 1, .most = 16,
        .help = "paths at once; the bits do not depend on it",
        .values = (const Value[]){{"auto", "the most that this processor has"}, {NULL, NULL}}},
    {"--kernel", NULL, WORD, AT(kernel), .help = "of the tracer; the bits do not depend on it",
        .values = (const Value[]){{"auto", "specialised for what the scene has"},
            {"generic", "the general one"}, {NULL, NULL}}},
    {"--stats", "FILE", TEXT, AT(stats), .help = "figures as JSON (- for standard output)"},
    {"--quiet", NULL, FLAG, AT(quiet), .help = "no progress line"},
    {"--version", NULL, VERSION, 0, .help = "says which oneray this is"},
    {"--help", NULL, HELP, 0, .help = "says this; so does -h"},
};
enum { OPTIONS = sizeof table / sizeof *table };

static void help_of(const Option *option)
{
    int used = printf("  %s%s%s", option->name, option->argument && option->kind != PARAMETER ? " " : "",
        option->argument ? option->argument : "");
    if (used > 24)
        used = printf("\n") - 1;
    for (const char *line = option->help; line; line = strchr(line, '\n')) {
        line += *line == '\n';
        printf("%*s%.*s\n", 25 - used, "", (int)strcspn(line, "\n"), line);
        used = 0;
    }
    for (int v = 0; option->values && option->values[v].word; v++)
        printf("      %-13s%c     %s\n", option->values[v].word, v == option->unasked ? '*' : ' ',
            option->values[v].help);
}

NORETURN static void help(void)
{
    puts("usage: oneray SCENE.xml [-o PICTURE] [-Dname=value ...] [options]\n"
         "       oneray merge PART.film ... -o PICTURE [--exposure STOPS]\n"
         "\n"
         "- for SCENE.xml is standard input; --option=VALUE is --option VALUE; -- ends the options.\n"
         "Renders a scene (Mitsuba 3 XML) with the techniques of the lecture \"Probability Theory\", each\n"
         "selectable. All give the same picture on average and differ only in variance. Defaults: *.\n");
    for (int i = 0; i < OPTIONS; i++)
        help_of(&table[i]);
    puts("\nexit status: 0 done; 2 the command line, the scene or a file was wrong (standard error says where);\n"
         "70 a bug of oneray's");
    const char *last = "";
    fputs("\nkernels that run here:", stdout);
    for (int i = 0; kernel_built(i); i++) {
        const Kernel *kernel = kernel_built(i);
        if (!kernel_runs(i))
            continue;
        if (strcmp(last, kernel->precision))
            printf("%s %s x %d", *last ? ";" : "", kernel->precision, kernel->lanes);
        else
            printf(", %d", kernel->lanes);
        last = kernel->precision;
    }
    putchar('\n');
    exit(0);
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

static double real(const char *option, const char *word, double low, double high)
{
    char *end;
    double value = strtod(word, &end);
    if (end == word || *end || !(value > low && value < high))
        die("%s %s: a number between %g and %g is wanted", option, word, low, high);
    return value;
}

/* Whole numbers, up to four, with the marks between them that the argument's name has between its words. */
static void numbers(const Option *option, const char *word, uint64_t *to)
{
    const char *form = option->argument, *at = word;
    for (bool more = true; more; form++, at++, to++) {
        char *end;
        errno = 0;
        *to = strtoull(at, &end, 10);
        form += strcspn(form, ":,");
        if (!isdigit((unsigned char)*at) || errno || *to > MOST_SAMPLES || *end != *form)
            die("%s %s: %s is wanted", option->name, word, option->argument);
        more = *form;
        at = end;
    }
}

/* Which of the values the word is, or an error. */
static int value_of(const Option *option, const char *word)
{
    char known[160] = "";
    for (int v = 0; option->values[v].word; v++) {
        if (!strcmp(option->values[v].word, word))
            return v;
        strcat(known, v ? ", " : "");
        strcat(known, option->values[v].word);
    }
    die("%s %s is not supported (%s)", option->name, word, known);
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
    options->parameters[options->parameter_count++] = (Parameter){.name = copy, .value = equals + 1};
}

static void take(Options *o, const Option *option, const char *word)
{
    void *at = (char *)o + option->at;
    uint64_t range[2];
    switch (option->kind) {
    case TEXT: *(const char **)at = word; break;
    case WORD: *(const char **)at = option->values[value_of(option, word)].word; break;
    case CHOICE: *(int *)at = value_of(option, word); break;
    case WHOLE:
        *(uint64_t *)at = option->values && !strcmp(word, option->values->word)
                              ? 0
                              : whole(option->name, word, option->least, option->most);
        break;
    case REAL: *(double *)at = real(option->name, word, option->low, option->high); break;
    case RANGE:
        numbers(option, word, range);
        if (!range[1])
            die("--samples %s: COUNT is 1 at least", word);
        o->first_sample = range[0];
        o->sample_count = range[1];
        break;
    case CROP:
        numbers(option, word, o->crop);
        if (!o->crop[2] || !o->crop[3])
            die("--crop %s: WIDTH and HEIGHT are 1 at least", word);
        break;
    case STRATEGY:
        numbers(option, word, o->technique.strategy);
        if (!o->technique.strategy[1])
            die("--strategy %s: T is 1 at least, the eye", word);
        break;
    case FLAG: *(bool *)at = true; break;
    case PARAMETER: parameter(o, word); break;
    case HELP: help();
    case VERSION: printf("oneray %s\n", ONERAY_VERSION), exit(0);
    }
}

#define WORD_OF(name, word, help) word,
static const char *const estimators[] = {ESTIMATORS(WORD_OF)};
static const char *const light_choices[] = {LIGHT_CHOICES(WORD_OF)};

/* Without a ray to any: a light is chosen for what it sends out. */
static bool starts_at_lights(const Technique *t)
{
    return t->estimator == ESTIMATOR_LIGHT || t->estimator == ESTIMATOR_PHOTONS;
}

/* Options of a technique that the estimator has no use for. What was not asked for is -1. */
static void check_technique(const Technique *t, const Technique *asked)
{
    bool pairs = t->estimator == ESTIMATOR_BIDIRECTIONAL;
    if (((asked->mis >= 0 && !pairs) || asked->mis_pdf >= 0) && t->estimator != ESTIMATOR_MIS)
        die("%s weighs two ways to find a light: it goes with --estimator mis only",
            asked->mis >= 0 ? "--mis" : "--mis-pdf");
    if (t->strategy[1] && !pairs)
        die("--strategy is one of --estimator bidirectional's: it does nothing with --estimator %s",
            estimators[t->estimator]);
    if ((t->radius > 0 || t->photons) && t->estimator != ESTIMATOR_PHOTONS)
        die("%s is one of --estimator photons': it does nothing with --estimator %s",
            t->radius > 0 ? "--radius" : "--photons", estimators[t->estimator]);
    if (pairs && asked->light_choice > LIGHT_CHOICE_CONTRIBUTION)
        die("--estimator bidirectional: --light-choice %s is not supported (uniform, power, contribution)",
            light_choices[asked->light_choice]);
    if (asked->candidates && t->light_choice != LIGHT_CHOICE_RESAMPLED)
        die("--candidates are those of --light-choice resampled: there are none with --light-choice %s",
            light_choices[t->light_choice]);
    if (t->estimator == ESTIMATOR_WALK && (asked->light_choice >= 0 || asked->light_points >= 0))
        die("--estimator walk sends no ray to a light: %s does nothing there",
            asked->light_choice >= 0 ? "--light-choice" : "--light-points");
    if (starts_at_lights(t) && asked->light_points >= 0)
        die("--estimator %s starts anywhere on a light: --light-points does nothing there",
            estimators[t->estimator]);
    if (starts_at_lights(t) && asked->light_choice >= LIGHT_CHOICE_CONTRIBUTION)
        die("--estimator %s chooses a light before it knows where it shines: --light-choice uniform or power",
            estimators[t->estimator]);
    if (t->mis_pdf == MIS_PDF_SURVIVAL && t->roulette == ROULETTE_NONE)
        die("--mis-pdf survival: with --roulette none every path survives");
}

const Kernel *options_kernel(const Options *o)
{
    const Kernel *kernel = kernel_find(o->precision, (int)o->lanes);
    if (!kernel)
        die("--lanes %d --precision %s: this build or this processor has no such kernel (--help lists them)",
            (int)o->lanes, o->precision);
    return kernel;
}

/* What can be seen to make no sense before the scene is read. */
static void check_given(const Options *o, const Technique *asked)
{
    if (!o->scene)
        die("a scene is wanted: oneray SCENE.xml -o OUT.exr (--help tells more)");
    check_technique(&o->technique, asked);
    if (o->spp && o->seconds > 0)
        die("--spp and --time: give one of them");
    if (o->error > 0 && o->technique.sampler == SAMPLER_SOBOL)
        die("--error wants the standard errors of independent samples: not with --sampler sobol");
    if ((o->sample_count != 0) != (o->film != NULL))
        die("--samples and --film go together: --samples FIRST:COUNT --film PART.film");
    if (o->sample_count && (o->spp || o->seconds > 0 || o->error > 0))
        die("--samples says which samples are rendered: --spp, --time and --error do not go with it");
    bool seen = o->png || o->show;
    if (o->film && (o->output || seen))
        die("--film writes a part; `oneray merge PART.film ... -o OUT.exr` makes the picture");
    if (o->check && (o->output || seen || o->film || o->checkpoint || o->stats))
        die("--check writes nothing: -o, --png, --show, --film, --checkpoint and --stats do not go with it");
    if (!o->film && !o->output && !seen && !o->stats && !o->check)
        die("nothing to do: give -o OUT.exr (or --show for a look, --stats - for the figures alone)");
    if (o->show && o->stats && !strcmp(o->stats, "-"))
        die("--show and --stats -: both go to standard output; give --stats FILE");
    if (!o->checkpoint && (o->resume || o->checkpoint_seconds > 0))
        die("%s: --checkpoint FILE is wanted with it", o->resume ? "--resume" : "--checkpoint-seconds");
    if (o->png)
        picture_check_png(o->png);
    if (o->output)
        picture_check_name(o->output, seen ? 0 : o->exposure);
    if (strcmp(o->precision, "auto"))
        options_kernel(o);
}

static const Option *option_named(const char *word, size_t length)
{
    for (int i = 0; i < OPTIONS; i++)
        if (table[i].kind == PARAMETER ? !strncmp(word, table[i].name, 2)
                                       : !strncmp(word, table[i].name, length) && !table[i].name[length])
            return &table[i];
    return NULL;
}

/* The option that the word at *at is, or NULL. *value is what stands behind its "=", else the next word, to which
   *at moves on. */
static const Option *read_option(char ***at, const char **value)
{
    const char *word = strcmp(**at, "-h") ? **at : "--help";
    size_t length = strncmp(word, "--", 2) ? strlen(word) : strcspn(word, "=");
    const Option *option = option_named(word, length);
    if (!option)
        return NULL;
    *value = option->kind == PARAMETER ? word + 2 : word + length + 1;
    if (option->kind < FLAG && !word[length] && !(*value = *++*at))
        die("%s: a value is wanted after it", word);
    if (option->kind >= FLAG && option->kind != PARAMETER && word[length])
        die("%s: it takes no value", word);
    return option;
}

/* A name is what does not begin with '-', what stands behind "--", and "-" itself. */
static bool is_name(const char *word, bool names_only) { return names_only || *word != '-' || !word[1]; }

static void read_words(Options *o, char **at)
{
    const Option *option;
    const char *value;
    bool names_only = false;
    for (; *at; at++)
        if (!names_only && !strcmp(*at, "--"))
            names_only = true;
        else if (is_name(*at, names_only) && o->scene)
            die("%s and %s: one scene is wanted", o->scene, *at);
        else if (is_name(*at, names_only))
            o->scene = *at;
        else if ((option = read_option(&at, &value)))
            take(o, option, value);
        else
            die("%s is no option (--help lists them)", *at);
}

/* oneray merge PART.film … -o PICTURE */
static void read_merge(Options *o, int count, char **at)
{
    const Option *option;
    const char *value;
    bool names_only = false;
    o->parts = allocate((size_t)count, sizeof *o->parts);
    for (; *at; at++) {
        const char *word = *at;
        if (!names_only && !strcmp(word, "--"))
            names_only = true;
        else if (is_name(word, names_only))
            o->parts[o->part_count++] = *at;
        else if (!(option = read_option(&at, &value)) || !(option->merges || option->kind == HELP))
            die("merge: %s is no option (oneray merge PART.film ... -o OUT.exr)", word);
        else if (option->kind == TEXT && o->output)
            die("merge: one -o OUT.exr is wanted");
        else
            take(o, option, value);
    }
    if (!o->output)
        die("merge: -o OUT.exr is wanted");
    if (!o->part_count)
        die("merge: no film is given (oneray merge PART.film ... -o OUT.exr)");
    picture_check_name(o->output, o->exposure);
}

static int *choice(Technique *technique, const Option *option)
{
    return (int *)((char *)technique + (option->at - AT(technique)));
}

Options options_read(int count, char **words)
{
    Options o = {0};
    if (count > 1 && !strcmp(words[1], "merge")) {
        read_merge(&o, count, words + 2);
        return o;
    }
    for (int i = 0; i < OPTIONS; i++)
        if (table[i].kind == CHOICE)
            *choice(&o.technique, &table[i]) = -1;
        else if (table[i].kind == WORD)
            take(&o, &table[i], table[i].values[table[i].unasked].word);
    if (count)
        read_words(&o, words + 1);
    Technique asked = o.technique;
    if (starts_at_lights(&asked) && asked.light_choice < 0)
        o.technique.light_choice = LIGHT_CHOICE_POWER;
    for (int i = 0; i < OPTIONS; i++)
        if (table[i].kind == CHOICE && *choice(&o.technique, &table[i]) < 0)
            *choice(&o.technique, &table[i]) = table[i].unasked;
    check_given(&o, &asked);
    if (!o.technique.candidates)
        o.technique.candidates = FEW_CANDIDATES;
    if (o.preview && !o.size[0] && !o.size[1])
        o.size[0] = 256;
    if (o.preview && !o.spp && !o.sample_count && o.seconds <= 0)
        o.seconds = 1;
    if (o.checkpoint_seconds <= 0)
        o.checkpoint_seconds = 60;
    return o;
}

void options_free(Options *o)
{
    for (int i = 0; i < o->parameter_count; i++)
        free((char *)o->parameters[i].name);
    free(o->parts);
}

/* Would a path in a closed scene never be cut short? Only where a material absorbs nothing. */
static const Material *absorbs_nothing(const Description *scene)
{
    for (int i = 0; i < scene->material_count; i++) {
        MaterialTraits traits = material_traits(&scene->materials[i]);
        for (int c = 0; c < 3 && traits.reflected; c++)
            if (traits.reflected->least[c] >= 1 && !traits.absorbs)
                return &scene->materials[i];
    }
    return NULL;
}

static bool passes_something(const Description *scene)
{
    bool passes = scene->medium_count > 0;
    for (int i = 0; i < scene->material_count; i++)
        passes = passes || scene->materials[i].kind == MATERIAL_NULL
                 || material_traits(&scene->materials[i]).unbent;
    return passes;
}

void options_check(const Options *options, const Description *scene)
{
    const Frame *frame = &scene->sensor.frame;
    const uint64_t *crop = options->crop, width = (uint64_t)frame->width, height = (uint64_t)frame->height;
    if (crop[2] > width || crop[0] > width - crop[2] || crop[3] > height || crop[1] > height - crop[3])
        die("--crop: the image has %d x %d pixels", frame->width, frame->height);
#define X(NAME, name, words) words,
    static const char *const kinds[EMITTER_KINDS] = {EMITTERS(X)};
#undef X
    for (int i = 0; i < scene->emitter_count; i++) {
        const Emitter *light = &scene->emitters[i];
        if (!emitter_has_power(light))
            note(light, "this light has no power and is left out");
        LightFrom from = emitter_traits(light).from;
        if (options->technique.estimator == ESTIMATOR_WALK && (from == FROM_POINT || from == FROM_AFAR))
            fail(light,
                "--estimator walk: no random ray hits a %s, its light would be "
                "missing; use nee or mis",
                kinds[light->kind]);
    }
    const char *estimator = estimators[options->technique.estimator];
    bool from_lights = options->technique.estimator >= ESTIMATOR_LIGHT;
    const int choice = options->technique.light_choice;
    bool passing = scene->passing && passes_something(scene);
    if (from_lights && passing)
        die("%s: media, and boundaries that are no vertices (integrator volpath with null, mask or thindielectric), are not "
            "supported with --estimator %s (walk, nee, mis)",
            options->scene, estimator);
    if (passing && (choice == LIGHT_CHOICE_RESAMPLED || (choice == LIGHT_CHOICE_LEARNED && scene->medium_count)))
        die("%s: media%s are not supported with --light-choice %s (uniform, power, contribution)", options->scene,
            choice == LIGHT_CHOICE_RESAMPLED ? ", and boundaries that are no vertices," : "", light_choices[choice]);
    if (from_lights && scene->hide_emitters)
        die("%s: hide_emitters is not supported with --estimator %s", options->scene, estimator);
    for (int i = 0; from_lights && i < scene->material_count; i++)
        if (scene->materials[i].bump.texture)
            fail(&scene->materials[i], "--estimator %s: a bumpmap or normalmap is not supported there", estimator);
    if (scene->max_depth < 0 && options->technique.roulette == ROULETTE_NONE)
        die("--roulette none: %s has max_depth -1, its paths would never end", options->scene);
    const Material *endless = scene->max_depth < 0 ? absorbs_nothing(scene) : NULL;
    if (endless)
        note(endless,
            "this material absorbs nothing and max_depth is -1: a path that cannot leave will be an error");
}

void options_technique(const Technique *t, char *text, int size)
{
    Technique technique = *t;
    for (int i = 0, used = 0; i < OPTIONS; i++)
        if (table[i].at == AT(technique.candidates) && t->light_choice == LIGHT_CHOICE_RESAMPLED)
            used += snprintf(text + used, (size_t)(size - used), " %s %llu", table[i].name,
                (unsigned long long)t->candidates);
        else if (table[i].at == AT(technique.radius) && t->radius > 0)
            used += snprintf(text + used, (size_t)(size - used), " %s %.17g", table[i].name, t->radius);
        else if (table[i].at == AT(technique.photons) && t->photons)
            used += snprintf(text + used, (size_t)(size - used), " %s %llu", table[i].name,
                (unsigned long long)t->photons);
        else if (table[i].kind == CHOICE && (!table[i].estimators || table[i].estimators >> t->estimator & 1))
            used += snprintf(text + used, (size_t)(size - used), "%s%s %s", used ? " " : "", table[i].name,
                table[i].values[*choice(&technique, &table[i])].word);
        else if (table[i].kind == STRATEGY && t->strategy[1])
            used += snprintf(text + used, (size_t)(size - used), " %s %llu,%llu", table[i].name,
                (unsigned long long)t->strategy[0], (unsigned long long)t->strategy[1]);
}
