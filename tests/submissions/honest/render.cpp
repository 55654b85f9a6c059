// A path tracer as a student may write it: next event estimation, one light of N, mirrors, glass, roulette.
//
//     render SCENE.json SPP SEED OUTPUT.pfm
//
// The scene is what "raycheck scene NAME --as json" prints.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "json.hpp"

const double PI = 3.14159265358979323846, FAR = 1e30, NEAR = 1e-6;

struct Vec { double x = 0, y = 0, z = 0; };
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(Vec a, Vec b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
Vec operator*(Vec a, double s) { return {a.x * s, a.y * s, a.z * s}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Vec unit(Vec a) { return a * (1 / std::sqrt(dot(a, a))); }
Vec vec(const Json &j) { return {j.at(0).number, j.at(1).number, j.at(2).number}; }

struct Random
{
    uint64_t state;
    double next() // splitmix64
    {
        uint64_t z = state += 0x9E3779B97F4A7C15u;
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
        z = (z ^ z >> 27) * 0x94D049BB133111EBu;
        return double((z ^ z >> 31) >> 11) * 0x1p-53;
    }
};

struct Material
{
    std::string type;
    bool two_sided = false;
    Vec reflectance;
    double eta = 1, weight = 0;
    std::vector<Material> parts;

    explicit Material(const Json &j) : type(j["type"].text), two_sided(j["two_sided"].number != 0)
    {
        if (j.has("reflectance"))
            reflectance = vec(j["reflectance"]);
        if (j.has("eta") && j["eta"].items.empty())
            eta = j["eta"].number;
        if (j.has("parts")) {
            weight = j["weight_of_second"].number;
            for (const Json &part : j["parts"].items)
                parts.emplace_back(part);
        }
    }
};

struct Primitive // flat: a + s u + t v, s and t from 0 to 1 (a triangle: s + t ≤ 1; a disk: s² + t² ≤ 1); or a sphere
{
    enum Kind { PARALLELOGRAM, TRIANGLE, DISK, SPHERE } kind;
    Vec a, u, v, normal, radiance;
    double radius = 0, side = 1, area = 0;
    int material;

    explicit Primitive(const Json &j) : radiance(vec(j["radiance"])), material(int(j["material"].number))
    {
        const std::string &type = j["type"].text;
        if (type == "sphere") {
            kind = SPHERE;
            a = vec(j["center"]);
            radius = j["radius"].number;
            side = j["inward"].number != 0 ? -1 : 1;
            area = 4 * PI * radius * radius;
            return;
        }
        normal = vec(j["normal"]);
        if (type == "triangle") {
            kind = TRIANGLE;
            a = vec(j["vertices"].at(0));
            u = vec(j["vertices"].at(1)) - a;
            v = vec(j["vertices"].at(2)) - a;
        } else {
            kind = type == "disk" ? DISK : PARALLELOGRAM;
            a = vec(j[type == "disk" ? "center" : "corner"]);
            u = vec(j[type == "disk" ? "axis_u" : "edge_u"]);
            v = vec(j[type == "disk" ? "axis_v" : "edge_v"]);
        }
        Vec n = cross(u, v);
        area = std::sqrt(dot(n, n)) * (kind == TRIANGLE ? 0.5 : kind == DISK ? PI : 1);
    }

    double meet(Vec o, Vec d) const
    {
        if (kind == SPHERE) {
            Vec c = o - a;
            double b = dot(c, d), disc = b * b - dot(c, c) + radius * radius;
            if (disc < 0)
                return FAR;
            double root = std::sqrt(disc);
            return -b - root > NEAR ? -b - root : -b + root > NEAR ? -b + root : FAR;
        }
        Vec n = cross(u, v);
        double below = dot(n, d);
        if (below == 0)
            return FAR;
        double t = dot(n, a - o) / below;
        if (t <= NEAR)
            return FAR;
        Vec p = o + d * t - a;
        double nn = dot(n, n), s = dot(cross(p, v), n) / nn, r = dot(cross(u, p), n) / nn;
        bool inside = kind == DISK ? s * s + r * r <= 1 : s >= 0 && r >= 0 && (kind == TRIANGLE ? s + r <= 1 : s <= 1 && r <= 1);
        return inside ? t : FAR;
    }

    Vec normal_at(Vec p) const { return kind == SPHERE ? (p - a) * (side / radius) : normal; }

    Vec sample(Random &random) const // a point, uniform on the area
    {
        double s = random.next(), t = random.next();
        if (kind == SPHERE) {
            double z = 1 - 2 * s, r = std::sqrt(std::max(0.0, 1 - z * z));
            return a + Vec{r * std::cos(2 * PI * t), r * std::sin(2 * PI * t), z} * radius;
        }
        if (kind == DISK)
            return a + u * (std::sqrt(s) * std::cos(2 * PI * t)) + v * (std::sqrt(s) * std::sin(2 * PI * t));
        if (kind == TRIANGLE && s + t > 1) {
            s = 1 - s;
            t = 1 - t;
        }
        return a + u * s + v * t;
    }
};

struct PointLight { Vec position, intensity; };

struct Scene
{
    int width, height, max_depth, roulette_depth;
    Vec origin, top_left, top_right, bottom_left, sky;
    std::vector<Material> materials;
    std::vector<Primitive> primitives;
    std::vector<int> lamps;
    std::vector<PointLight> points;

    explicit Scene(const Json &j)
        : width(int(j["camera"]["width"].number)), height(int(j["camera"]["height"].number)),
          max_depth(int(j["max_depth"].number)), roulette_depth(int(j["roulette_depth"].number)),
          origin(vec(j["camera"]["origin"])), top_left(vec(j["camera"]["top_left"])),
          top_right(vec(j["camera"]["top_right"])), bottom_left(vec(j["camera"]["bottom_left"])), sky(vec(j["sky"]))
    {
        for (const Json &m : j["materials"].items)
            materials.emplace_back(m);
        for (const Json &p : j["primitives"].items) {
            primitives.emplace_back(p);
            if (dot(primitives.back().radiance, {1, 1, 1}) > 0)
                lamps.push_back(int(primitives.size()) - 1);
        }
        for (const Json &l : j["lights"].items) {
            if (l["type"].text != "point light")
                throw std::runtime_error("a " + l["type"].text + " is not supported");
            points.push_back({vec(l["position"]), vec(l["intensity"])});
        }
    }

    int hit(Vec o, Vec d, double &nearest) const
    {
        int found = -1;
        for (size_t i = 0; i < primitives.size(); i++) {
            double t = primitives[i].meet(o, d);
            if (t < nearest) {
                nearest = t;
                found = int(i);
            }
        }
        return found;
    }

    bool free(Vec from, Vec to) const
    {
        Vec d = to - from;
        double distance = std::sqrt(dot(d, d)), nearest = distance * (1 - 1e-6);
        return hit(from, d * (1 / distance), nearest) < 0;
    }
};

// Next event estimation: one of N lights, so that its light counts N times. The BRDF's π is put in by the caller.
Vec direct(const Scene &scene, Random &random, Vec p, Vec n)
{
    size_t count = scene.lamps.size() + scene.points.size();
    if (!count)
        return {};
    size_t pick = std::min(size_t(random.next() * double(count)), count - 1);
    double lights = double(count);
    if (pick >= scene.lamps.size()) {
        const PointLight &light = scene.points[pick - scene.lamps.size()];
        Vec l = light.position - p;
        double squared = dot(l, l), cosine = dot(n, l) / std::sqrt(squared);
        return cosine > 0 && scene.free(p, light.position) ? light.intensity * (lights * cosine / squared) : Vec{};
    }
    const Primitive &lamp = scene.primitives[size_t(scene.lamps[pick])];
    Vec q = lamp.sample(random), l = q - p;
    double squared = dot(l, l), cosine = dot(n, l) / std::sqrt(squared);
    double cosine_light = -dot(lamp.normal_at(q), l) / std::sqrt(squared);
    if (cosine <= 0 || cosine_light <= 0 || !scene.free(p, q))
        return {};
    return lamp.radiance * (lights * lamp.area * cosine * cosine_light / squared);
}

Vec bounce(Random &random, Vec n) // by the cosine
{
    double s = random.next(), r = std::sqrt(s), phi = 2 * PI * random.next();
    Vec t = unit(cross(std::fabs(n.x) > 0.5 ? Vec{0, 1, 0} : Vec{1, 0, 0}, n)), b = cross(n, t);
    return t * (r * std::cos(phi)) + b * (r * std::sin(phi)) + n * std::sqrt(std::max(0.0, 1 - s));
}

double fresnel(double c, double eta) // eta: index beyond over index before
{
    double s2 = (1 - c * c) / (eta * eta);
    if (s2 >= 1)
        return 1;
    double t = std::sqrt(1 - s2), rs = (c - eta * t) / (c + eta * t), rp = (eta * c - t) / (eta * c + t);
    return (rs * rs + rp * rp) / 2;
}

Vec radiance(const Scene &scene, Random &random, Vec o, Vec d)
{
    Vec total, throughput{1, 1, 1};
    bool specular = true; // the eye
    for (int depth = 1;; depth++) {
        double t = FAR;
        int index = scene.hit(o, d, t);
        if (index < 0)
            return total + throughput * scene.sky;
        const Primitive &primitive = scene.primitives[size_t(index)];
        Vec p = o + d * t, n = primitive.normal_at(p);
        bool front = dot(n, d) < 0;
        if (specular && front)
            total = total + throughput * primitive.radiance;
        if (depth == scene.max_depth)
            return total;
        const Material *material = &scene.materials[size_t(primitive.material)];
        while (!material->parts.empty())
            material = &material->parts[random.next() < material->weight ? 1 : 0];
        if (material->type == "dielectric") {
            double eta = front ? material->eta : 1 / material->eta;
            Vec m = front ? n : n * -1.0;
            double c = -dot(m, d);
            if (random.next() < fresnel(c, eta))
                d = d + m * (2 * c);
            else {
                throughput = throughput * (1 / (eta * eta)); // radiance is compressed
                d = unit(d * (1 / eta) + m * (c / eta - std::sqrt(std::max(0.0, 1 - (1 - c * c) / (eta * eta)))));
            }
            specular = true;
        } else {
            if (!front && !material->two_sided)
                return total;
            Vec m = front ? n : n * -1.0;
            if (material->type == "mirror") {
                d = d - m * (2 * dot(m, d));
                specular = true;
            } else if (material->type == "diffuse") {
                total = total + throughput * material->reflectance * direct(scene, random, p, m) * (1 / PI);
                d = bounce(random, m);
                specular = false;
            } else {
                throw std::runtime_error("a " + material->type + " is not supported");
            }
            throughput = throughput * material->reflectance;
        }
        if (depth >= scene.roulette_depth) {
            double survive = std::min(1.0, std::max({throughput.x, throughput.y, throughput.z}));
            if (random.next() >= survive)
                return total;
            throughput = throughput * (1 / survive);
        }
        o = p;
    }
}

int main(int count, char **arguments)
try {
    if (count != 5)
        throw std::runtime_error("render SCENE.json SPP SEED OUTPUT.pfm");
    std::ifstream file(arguments[1]);
    std::string text((std::istreambuf_iterator<char>(file)), {});
    Scene scene(JsonReader(text).value());
    int spp = std::atoi(arguments[2]);
    std::FILE *out = std::fopen(arguments[4], "wb");
    if (!out)
        throw std::runtime_error(std::string(arguments[4]) + " cannot be written");
    std::fprintf(out, "PF\n%d %d\n-1\n", scene.width, scene.height);
    for (int row = scene.height - 1; row >= 0; row--) // PFM begins at the bottom
        for (int column = 0; column < scene.width; column++) {
            Random random{(uint64_t(std::atoll(arguments[3])) << 32) + uint64_t(row * scene.width + column)};
            random.state = uint64_t(random.next() * 0x1p53) << 11;
            Vec sum;
            for (int s = 0; s < spp; s++) {
                double x = (column + random.next()) / scene.width, y = (row + random.next()) / scene.height;
                Vec d = scene.top_left + (scene.top_right - scene.top_left) * x + (scene.bottom_left - scene.top_left) * y;
                sum = sum + radiance(scene, random, scene.origin, unit(d));
            }
            float rgb[3] = {float(sum.x / spp), float(sum.y / spp), float(sum.z / spp)};
            std::fwrite(rgb, sizeof(float), 3, out);
        }
    return std::fclose(out) != 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "render: %s\n", error.what());
    return 1;
}
