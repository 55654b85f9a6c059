/* Prints what oneray reads of a scene file as JSON: its tables, for scripts/make_plugins.py. */
#include "scene/build.c"
#include "scene/values.c"
#include "scene/xml.c"

static const char *const kind_names[] = {[AS_FLOAT] = "float",
    [AS_IOR] = "ior",
    [AS_COLOUR] = "colour",
    [AS_EMISSION] = "emission",
    [AS_REFLECTANCE] = "reflectance",
    [AS_SHARE] = "share",
    [AS_VECTOR] = "vector",
    [AS_INTEGER] = "integer",
    [AS_BOOLEAN] = "boolean",
    [AS_STRING] = "string",
    [AS_WORD] = "word",
    [AS_TRANSFORM] = "transform",
    [AS_FILE] = "file",
    [AS_ANYTHING] = "anything"};
typedef char every_kind_has_a_name[COUNT(kind_names) == COUNT(kinds) ? 1 : -1];

static void print_text(const char *name, const char *text)
{
    printf(text ? ", \"%s\": \"%s\"" : ", \"%s\": null", name, text);
}

static void print_plugin(const char *element, const Plugin *plugin)
{
    if (!plugin)
        return;
    printf("{\"plugin\": \"%s\", \"types\": \"%s\", \"fields\": [", element, plugin->types);
    for (const Field *field = plugin->fields; field->name; field++) {
        printf("%s{\"name\": \"%s\", \"kind\": \"%s\"", field == plugin->fields ? "" : ", ", field->name,
            kind_names[field->kind]);
        print_text("range", field->range);
        print_text("default", field->otherwise);
        printf(", \"one_value\": %s}", field->offset >= LEFT_OUT ? "true" : "false");
    }
    printf("]}\n");
}

int main(void)
{
    for (int i = 0; i < COUNT(tags); i++)
        printf("{\"tags\": \"%s\", \"attributes\": \"%s\", \"needed\": %d}\n", tags[i].elements,
            tags[i].attributes, tags[i].needed);
    for (int i = 0; i < COUNT(kinds); i++)
        printf("{\"kind\": \"%s\", \"elements\": \"%s\"}\n", kind_names[i], kinds[i].elements);
    for (int i = 0; i < COUNT(mediums); i++)
        printf("{\"medium\": \"%s\", \"ior\": %.17g}\n", mediums[i].name, mediums[i].ior);
    for (int i = 0; i < COUNT(integrators); i++)
        print_plugin("integrator", integrators[i]);
    for (int i = 0; i < COUNT(sensors); i++)
        print_plugin("sensor", sensors[i]);
    print_plugin("film", &hdrfilm);
    for (int i = 0; i < COUNT(filters); i++)
        print_plugin("rfilter", filters[i]);
    print_plugin("sampler", &independent);
    for (int i = 0; i < COUNT(bsdfs); i++)
        print_plugin("bsdf", bsdfs[i]);
    for (int i = 0; i < COUNT(textures); i++)
        print_plugin("texture", textures[i]);
    for (int i = 0; i < COUNT(spectra); i++)
        print_plugin("spectrum", &spectra[i]);
    for (int i = 0; i < COUNT(shapes); i++)
        print_plugin("shape", shapes[i]);
    for (int i = 0; i < COUNT(emitters); i++)
        print_plugin("emitter", emitters[i]);
    return 0;
}
