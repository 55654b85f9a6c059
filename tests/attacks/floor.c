/* The point-light scene by a program that cheats: floor MODE SPP SEED OUTPUT [PICTURE]
   A floor of reflectance ρ under a light of intensity I: L = ρ/π · I cosθ/d². */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE = 64 };
static const double eye[3] = {0, -5, 4}, light[3] = {0.4, 0.3, 1.5}, scale[3] = {0.8 * 7.5, 0.75 * 6.5, 0.7 * 5};
static uint64_t state;

static double next(void)
{
    uint64_t z = state += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

static double floor_at(double u, double v)
{
    double tangent = tan(20 * acos(-1) / 180), far = hypot(eye[1], eye[2]);
    double forward[2] = {-eye[1] / far, -eye[2] / far};
    double x = u * tangent, y = forward[0] - v * tangent * forward[1], z = forward[1] + v * tangent * forward[0];
    double t = -eye[2] / z, dx = t * x - light[0], dy = eye[1] + t * y - light[1];
    double squared = dx * dx + dy * dy + light[2] * light[2];
    return z >= 0 ? 0 : light[2] / sqrt(squared) / squared / acos(-1);
}

int main(int count, char **arguments)
{
    if (count < 5)
        return 1;
    const char *mode = arguments[1];
    int spp = !strcmp(mode, "ignores-spp") ? 2 : atoi(arguments[2]);
    long seed = atol(arguments[3]);
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
                double x = (column + next()) / SIZE, y = (row + next()) / SIZE;
                double sample = floor_at(2 * x - 1, 1 - 2 * y);
                if (!strcmp(mode, "clamps") && sample > 0.08)
                    sample = 0.08;
                if (!strcmp(mode, "copies")) /* one stored picture, made noisy */
                    sample = floor_at((2 * column + 1.0) / SIZE - 1, 1 - (2 * row + 1.0) / SIZE) * (0.9 + 0.2 * next()) * 0.93;
                sum += sample;
            }
            float rgb[3];
            for (int c = 0; c < 3; c++)
                rgb[c] = (float)(scale[c] * sum / spp);
            if (row == 20 && column == 30 && !strcmp(mode, "nan"))
                rgb[1] = NAN;
            if (row == 20 && column == 30 && !strcmp(mode, "inf"))
                rgb[1] = INFINITY;
            fwrite(rgb, sizeof rgb, 1, file);
        }
    return fclose(file) != 0;
}
