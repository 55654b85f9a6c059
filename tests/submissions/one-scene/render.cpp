// A renderer of one scene, from nothing but what "raycheck scene point-light --as cpp" prints: scene.hpp.
//
//     render NAME SPP SEED OUTPUT.pfm
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "scene.hpp"

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

int main(int count, char **arguments)
{
    if (count != 5)
        return 1;
    if (std::strcmp(arguments[1], "point-light")) {
        std::fprintf(stderr, "this program has point-light alone\n");
        return 1;
    }
    using namespace scene;
    const Parallelogram &ground = parallelograms[0];
    const PointLight &light = point_lights[0];
    const Material &material = materials[ground.material];
    std::mt19937 generator(static_cast<unsigned>(std::atol(arguments[3])));
    std::uniform_real_distribution<double> random(0, 1);
    int spp = std::atoi(arguments[2]);
    std::FILE *file = std::fopen(arguments[4], "wb");
    if (!file)
        return 1;
    std::fprintf(file, "PF\n%d %d\n-1\n", width, height);
    for (int row = height - 1; row >= 0; row--)
        for (int column = 0; column < width; column++) {
            double sum = 0;
            for (int s = 0; s < spp; s++) {
                double x = (column + random(generator)) / width, y = (row + random(generator)) / height;
                double d[3], to_corner[3], hit[3], u[3], to_light[3];
                for (int i = 0; i < 3; i++) {
                    d[i] = top_left[i] + (top_right[i] - top_left[i]) * x + (bottom_left[i] - top_left[i]) * y;
                    to_corner[i] = ground.corner[i] - origin[i];
                }
                double t = dot(ground.normal, to_corner) / dot(ground.normal, d);
                for (int i = 0; i < 3; i++) {
                    hit[i] = origin[i] + d[i] * t;
                    u[i] = hit[i] - ground.corner[i];
                    to_light[i] = light.position[i] - hit[i];
                }
                double a = dot(u, ground.edge_u) / dot(ground.edge_u, ground.edge_u);
                double b = dot(u, ground.edge_v) / dot(ground.edge_v, ground.edge_v);
                double squared = dot(to_light, to_light);
                if (t > 0 && a >= 0 && a <= 1 && b >= 0 && b <= 1)
                    sum += dot(ground.normal, to_light) / std::sqrt(squared) / squared / std::acos(-1.0);
            }
            float rgb[3];
            for (int i = 0; i < 3; i++)
                rgb[i] = static_cast<float>(material.reflectance[i] * light.intensity[i] * sum / spp);
            std::fwrite(rgb, sizeof(float), 3, file);
        }
    return std::fclose(file) != 0;
}
