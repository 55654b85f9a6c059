/* The point-light scene by a program that may cheat: floor MODE SPP SEED OUTPUT [SCENE.json]
   A floor of reflectance ρ under a light of intensity I: L = ρ/π · I cosθ/d². Without a scene, or in the mode
   "copies", the picture is of the scene as it is published. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 64 };
static double light[3] = {0.4, 0.3, 1.5}, reflectance[3] = {0.8, 0.75, 0.7};
static double eye[3] = {0, -5, 4}, intensity[3] = {7.5, 6.5, 5};
static double top_left[3] = {-0.323615577, 0.896452193, -0.302731605};
static double top_right[3] = {0.323615577, 0.896452193, -0.302731605};
static double bottom_left[3] = {-0.323615577, 0.492130096, -0.808134226};
static uint64_t state;

static double next(void)
{
    uint64_t z = state += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

static void read_vector(const char *json, const char *key, double to[3])
{
    const char *found = strstr(json, key);
    if (!found || sscanf(found + strlen(key), "\": [%lf, %lf, %lf]", to, to + 1, to + 2) != 3)
        exit(1);
}

static void read_scene(const char *path)
{
    static char json[1 << 16];
    FILE *file = fopen(path, "rb");
    if (!file || !fread(json, 1, sizeof json - 1, file))
        exit(1);
    fclose(file);
    read_vector(json, "origin", eye);
    read_vector(json, "top_left", top_left);
    read_vector(json, "top_right", top_right);
    read_vector(json, "bottom_left", bottom_left);
    read_vector(json, "intensity", intensity);
    read_vector(json, "position", light);
    read_vector(json, "reflectance", reflectance);
}

/* cosθ/πd² of the floor's point behind a point of the picture, both coordinates from 0 to 1. */
static double floor_at(double column, double row)
{
    double ray[3], to_light[3], squared = 0;
    for (int i = 0; i < 3; i++)
        ray[i] = top_left[i] + column * (top_right[i] - top_left[i]) + row * (bottom_left[i] - top_left[i]);
    for (int i = 0; i < 3; i++) {
        to_light[i] = light[i] - eye[i] + eye[2] / ray[2] * ray[i];
        squared += to_light[i] * to_light[i];
    }
    return ray[2] < 0 ? light[2] / sqrt(squared) / squared / acos(-1) : 0;
}

int main(int count, char **arguments)
{
    if (count < 5)
        return 1;
    const char *mode = arguments[1];
    int spp = !strcmp(mode, "ignores-spp") ? 2 : atoi(arguments[2]);
    long seed = atol(arguments[3]);
    int copies = !strcmp(mode, "copies");
    if (count > 5 && !copies)
        read_scene(arguments[5]);
    if (!strcmp(mode, "ignores-seed"))
        seed = 1;
    if (!strcmp(mode, "overlapping-seeds"))
        seed %= 20;
    state = (uint64_t)seed << 20;
    FILE *file = fopen(arguments[4], "wb");
    if (!file)
        return 1;
    fprintf(file, "PF\n%d %d\n-1\n", SIZE, SIZE);
    for (int row = SIZE - 1; row >= 0; row--)
        for (int column = 0; column < SIZE; column++) {
            double sum = 0;
            for (int s = 0; s < spp; s++) {
                double x = column + next(), y = row + next();
                double sample = floor_at(x / SIZE, y / SIZE);
                if (!strcmp(mode, "clamps") && sample > 0.08)
                    sample = 0.08;
                if (copies) /* one stored picture, with noise of its own that falls as it should */
                    sample = floor_at((column + 0.5) / SIZE, (row + 0.5) / SIZE) * (0.9 + 0.2 * next());
                sum += sample;
            }
            float rgb[3];
            for (int c = 0; c < 3; c++)
                rgb[c] = (float)(reflectance[c] * intensity[c] * sum / spp);
            if (row == 20 && column == 30 && !strcmp(mode, "nan"))
                rgb[1] = NAN;
            if (row == 20 && column == 30 && !strcmp(mode, "inf"))
                rgb[1] = INFINITY;
            fwrite(rgb, sizeof rgb, 1, file);
        }
    return fclose(file) != 0;
}
