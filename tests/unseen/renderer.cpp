/* A small path tracer that shares nothing with oneray, and can make the mistakes of students, one at a time.

     renderer SCENE.json --spp N --seed S [--mistake NAME] -o OUT.pfm
     renderer --list        NAME, the scenes that show it, what was done, and what is true of the picture

   Reads what `raycheck scene NAME --as json` writes: parallelograms, disks, spheres and triangles; diffuse, mirror,
   conductor, dielectric and blends of them; lights that are surfaces, points, spots, suns and the sky. One ray to one
   light, chosen uniformly, and one bounce at each vertex, weighed by the balance heuristic; Russian roulette. */
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <algorithm>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

/* name, scenes, what was done, what is true. */
#define MISTAKES(X) \
    X(flip_rows, "cornell-box many-lights", "the top row is written first into a PFM", "convention: upside down") \
    X(mirror_columns, "cornell-box many-lights", "the camera's right is its left", "convention: left and right exchanged") \
    X(rotated_half_turn, "cornell-box", "x and y both run backwards", "convention: turned by 180 degrees") \
    X(transposed, "cornell-box many-lights", "pixel[x * width + y]", "convention: x and y exchanged") \
    X(quarter_turn, "cornell-box", "the picture is turned by 90 degrees", "convention: turned by 90 degrees") \
    X(bgr, "cornell-box point-light", "channels written as B G R", "convention: red and blue exchanged") \
    X(gbr, "cornell-box", "channels written as G B R", "convention: channels rotated") \
    X(red_for_all, "cornell-box many-lights", "the red channel is written three times", "convention: grey, of red") \
    X(luminance_only, "cornell-box", "luminance .2126 .7152 .0722 in all channels", "convention: luminance alone") \
    X(mean_grey, "cornell-box", "the mean of the channels in all of them", "convention: grey, of the mean (not the luminance)") \
    X(gamma_22, "cornell-box area-light", "x^(1/2.2) before writing", "convention: gamma 2.2") \
    X(gamma_2, "area-light cornell-box", "square root before writing", "convention: gamma 2") \
    X(srgb_written, "cornell-box area-light", "sRGB's curve before writing", "convention: sRGB") \
    X(gamma_inverse, "area-light cornell-box", "x^2.2 before writing", "convention: power 2.2 (wrong way)") \
    X(clamped_at_1, "cornell-box mirror-light", "pixels cut at 1", "convention: pixels clamped at 1") \
    X(eight_bits, "cornell-box area-light", "pixels cut at 1 and rounded to 1/255", "convention: pixels clamped at 1") \
    X(reinhard, "cornell-box area-light", "x / (1 + x)", "convention: x/(1+x)") \
    X(exponential, "cornell-box area-light", "1 - exp(-x)", "convention: 1-exp(-x), another tone curve") \
    X(filmic, "area-light cornell-box", "the ACES fit of Narkowicz", "other: a tone curve") \
    X(log_tone, "area-light", "log(1 + x)", "other: a tone curve") \
    X(exposure_2, "many-lights cornell-box", "an exposure of 2 left in", "factor 2") \
    X(exposure_100, "point-light", "watts and centimetres: times 100", "factor 100") \
    X(divided_by_255, "area-light", "radiance / 255", "factor 1/255") \
    X(one_sample_too_many, "point-light", "divides by spp + 1", "factor spp/(spp+1)") \
    X(sum_not_mean, "point-light", "the sum of the samples is written", "factor spp") \
    X(xyz_written, "cornell-box open-sky", "CIE XYZ written as RGB", "other: a matrix of the channels") \
    X(saturated, "cornell-box", "saturation raised by 1.3", "other: a matrix of the channels") \
    X(warm_white, "cornell-box many-lights", "white balance: r x1.1, b x.85", "convention: channel factors 1.1 1 .85") \
    X(blue_dimmed, "area-light point-light", "blue x.95", "convention: channel factors 1 1 .95") \
    X(sepia_half, "cornell-box", "half of the colour is mixed with grey", "other: a matrix of the channels") \
    X(half_pixel, "cornell-box many-lights", "samples at [-.5,.5) of the pixel", "convention: half a pixel aside in x and y") \
    X(half_pixel_down, "many-lights cornell-box", "y is half a pixel too low", "convention: half a pixel aside in y") \
    X(whole_pixel, "cornell-box many-lights", "counts pixels from 1", "convention: a pixel aside in x and y") \
    X(pixel_middle, "cornell-box many-lights", "one ray through the pixel's middle", "convention: no jitter, middle") \
    X(pixel_corner, "cornell-box many-lights", "one ray through the pixel's upper left corner", "convention: no jitter, half a pixel aside") \
    X(jitter_half, "cornell-box many-lights", "jitter in [0,.5)", "convention: a quarter pixel aside, narrower") \
    X(tent_filter, "cornell-box many-lights", "a tent of radius 1", "convention: wider filter, tent") \
    X(gauss_filter, "cornell-box many-lights", "a Gaussian, sigma .5", "convention: wider filter, gaussian") \
    X(box_two, "cornell-box many-lights", "a box two pixels wide", "convention: wider filter, box 2") \
    X(blurred, "cornell-box", "3x3 mean over the picture", "convention: wider filter, box 3") \
    X(median_3x3, "cornell-box", "3x3 median as denoiser", "other: a median filter") \
    X(endpoints_at_edges, "cornell-box many-lights", "x / (width - 1)", "other: stretched by 64/63 from the corner") \
    X(wide_view, "cornell-box", "field of view 5 % too wide", "other: zoomed out by 1.05") \
    X(zoomed, "many-lights", "field of view 2 % too narrow", "other: zoomed in by 1.02") \
    X(angles_interpolated, "cornell-box many-lights", "angles, not the image plane, in equal steps", "other: barrel distortion") \
    X(camera_aside, "cornell-box", "the camera stands .03 to the right", "other: parallax") \
    X(depth_of_field, "cornell-box", "a lens of radius .03, focused at 3", "other: blurred by depth") \
    X(last_row_black, "many-lights", "y < height - 1", "other: one row is black") \
    X(last_column_black, "many-lights", "x < width - 1", "other: one column is black") \
    X(vignette, "many-lights area-light", "cos^4 of the angle to the axis", "other: dark corners") \
    X(black_level, "point-light cornell-box", "adds .01 to all", "other: .01 added") \
    X(samples_clamped_1, "cornell-box occluded-lights", "each sample cut at 1", "convention: bright samples clamped") \
    X(samples_clamped_half, "mirror-light", "each sample's channel cut at .5", "convention: bright samples clamped") \
    X(best_half, "cornell-box", "the brightest sample of eight dropped", "other: bright samples lost") \
    X(same_seed, "cornell-box", "the seed is ignored", "other: same noise in every image") \
    X(row_seed, "area-light", "one seed for every row", "other: rows share noise") \
    X(no_cosine, "point-light area-light", "NEE without the cosine at the surface", "direct x 1/cos, reflected light too bright unevenly") \
    X(cosine_twice, "point-light many-lights", "the cosine at the surface twice", "direct x cos") \
    X(cosine_root, "point-light", "sqrt of the cosine", "direct x cos^-.5") \
    X(no_light_cosine, "area-light many-lights", "NEE without the cosine at the light", "direct x 1/cos_l") \
    X(light_cosine_twice, "area-light many-lights", "the cosine at the light twice", "direct x cos_l") \
    X(one_over_d, "point-light area-light", "1/d", "direct x d") \
    X(no_distance, "point-light many-lights", "no 1/d^2", "direct x d^2") \
    X(d_cubed, "point-light", "1/d^3", "direct x 1/d") \
    X(d_plus_1, "point-light", "1/(1 + d^2), a softened falloff", "direct x d^2/(1+d^2)") \
    X(no_area, "many-lights area-light", "NEE not multiplied by the light's area", "direct x 1/A of each light") \
    X(area_twice, "many-lights occluded-lights", "multiplied by A twice", "direct x A of each light") \
    X(quarter_area, "area-light cornell-box", "half sides taken for sides: A/4", "direct x .25") \
    X(no_pi, "point-light area-light", "f_r = albedo", "direct x pi") \
    X(two_pi, "area-light many-lights", "f_r = albedo / 2 pi", "direct x .5") \
    X(pi_twice, "point-light", "divided by pi twice", "direct x 1/pi") \
    X(albedo_squared, "area-light point-light", "albedo twice in NEE", "direct x albedo") \
    X(albedo_ignored, "many-lights cornell-box", "albedo forgotten in NEE", "direct x 1/albedo") \
    X(albedo_halved, "cornell-box area-light", "albedo / 2 wherever it is used", "direct x .5, indirect less (each bounce x .5)") \
    X(albedo_srgb, "cornell-box area-light", "albedo decoded as sRGB", "albedo^~2.2 by channel") \
    X(albedo_inverted, "area-light", "1 - albedo", "reflected x (1-a)/a by channel") \
    X(albedo_at_most_half, "cornell-box", "albedo cut at .5", "reflected light: channels cut") \
    X(choice_forgotten, "many-lights occluded-lights", "not divided by 1/N", "direct x 1/N") \
    X(choice_twice, "many-lights", "multiplied by N twice", "direct x N") \
    X(last_never, "many-lights occluded-lights", "i = u (N - 1): the last light is never chosen", "last light's direct x 0, others x N/(N-1)") \
    X(first_always, "many-lights occluded-lights", "the first light, times N", "first light's direct xN, others x0") \
    X(power_choice_uniform_weight, "many-lights occluded-lights", "chosen by power, weighed by N", "direct of light i x N p_i") \
    X(one_light_only, "many-lights", "N taken as N - 1", "direct x (N-1)/N") \
    X(first_light_skipped, "many-lights occluded-lights", "loop from 1: the first light is not in the list", "first light's direct x 0") \
    X(both_sides_shine, "many-lights light-below-horizon", "|cos| at the light", "light shines from the back, too") \
    X(back_lit, "light-below-horizon sphere-light-far", "|cos| at the surface", "lit from below the horizon") \
    X(no_shadows, "area-light occluded-lights", "no shadow ray", "direct: shadows missing") \
    X(shadow_endless, "cornell-box mirror-light", "the shadow ray has no end, the light itself does not block", "direct: blocked by what is behind the lamp") \
    X(shadow_short, "area-light occluded-lights", "the shadow ray ends after 90 %", "direct: occluders near the lamp missed") \
    X(shadow_starts_late, "cornell-box area-light", "shadow rays start .1 off", "direct: contact shadows missing") \
    X(lamps_cast_no_shadow, "occluded-lights many-lights", "shadow rays pass what shines", "direct: shadows of lamps missing") \
    X(spheres_cast_no_shadow, "glass-ball lecture", "shadow rays pass spheres", "direct: shadows of spheres missing") \
    X(light_middle, "area-light cornell-box", "the middle of the lamp only", "direct: hard shadows") \
    X(light_diagonal, "area-light cornell-box", "u for v: the lamp's diagonal only", "direct: lamp sampled along its diagonal") \
    X(light_corner_dense, "area-light touching-light", "u^2 for u", "direct: lamp's samples crowd at one side") \
    X(light_quarter, "area-light occluded-lights", "u, v in [0,.5)", "direct: only a quarter of the lamp, as bright as all") \
    X(light_red, "many-lights cornell-box", "NEE uses the lamp's red for all channels", "direct: channels x r/g, r/b") \
    X(sphere_r_cubed, "spherical-light sphere-light-near", "area 4/3 pi r^3", "direct x r/3") \
    X(sphere_disk_area, "spherical-light sphere-light-far", "area pi r^2", "direct x .25") \
    X(sphere_half_area, "sphere-light-near spherical-light", "2 pi r^2, points over all of it", "direct x .5") \
    X(sphere_theta_uniform, "spherical-light sphere-light-near", "theta = pi u", "direct: points crowd at the poles") \
    X(sphere_as_point, "sphere-light-near spherical-light", "a point in the middle with I = L pi r^2", "direct: as of a point") \
    X(sphere_no_cosine, "spherical-light sphere-light-near", "no cosine at a sphere's point", "direct too bright") \
    X(point_flux, "point-light", "intensity taken as flux, / 4 pi", "direct x 1/(4 pi)") \
    X(point_pi, "point-light", "intensity times pi", "direct x pi") \
    X(spot_hard, "sun-and-spot", "no falloff between beam and cutoff", "spot: its rim too bright") \
    X(spot_smooth, "sun-and-spot", "smoothstep for the linear ramp", "spot: its rim another") \
    X(spot_half_angle, "sun-and-spot", "cutoff and beam taken as full angles", "spot: half as wide") \
    X(spot_cosine_ramp, "sun-and-spot", "the ramp is linear in the cosine", "spot: its rim another") \
    X(spot_squared, "sun-and-spot", "the ramp squared", "spot: its rim darker") \
    X(spot_no_distance, "sun-and-spot", "the spot without 1/d^2", "spot x d^2") \
    X(sun_no_cosine, "sun-and-spot", "the sun without the cosine", "sun x 1/cos") \
    X(sun_over_pi, "sun-and-spot", "irradiance divided by pi once more", "sun x 1/pi") \
    X(sun_no_shadow, "sun-and-spot", "the sun's shadow ray forgotten", "sun: its shadows missing") \
    X(sun_backwards, "sun-and-spot", "the sun shines the other way", "sun x 0") \
    X(sun_distance_1, "sun-and-spot", "the sun's shadow ray is one long", "sun: far shadows missing") \
    X(sky_unseen, "open-sky metal", "camera rays that hit nothing are black", "emission x 0 (the sky as seen)") \
    X(sky_twice, "open-sky", "sky met by bounces counted in full besides NEE", "direct x ~2 (double counted)") \
    X(sky_never_met, "open-sky", "the bounce loses the sky, NEE keeps its weight", "direct: MIS share lost") \
    X(sky_4pi, "open-sky", "hemisphere samples weighed as of a sphere", "direct: NEE share x 2") \
    X(sky_upper_half, "open-sky", "sky only above the horizon, z > 0", "the sky below z = 0 missing") \
    X(sky_no_shadow, "open-sky", "rays to the sky are never blocked", "direct: occlusion missing in part") \
    X(lamps_unseen, "cornell-box many-lights", "camera rays meet no lamp's light", "emission x 0") \
    X(lamps_double, "many-lights cornell-box", "emission at the first vertex twice", "emission x 2") \
    X(lamps_clamped, "cornell-box mirror-light", "emission seen by the camera cut at 1", "emission: cut at 1") \
    X(lamps_in_mirrors_lost, "mirror-light cornell-box", "emission after a mirror not counted", "light met in mirrors missing") \
    X(double_count, "cornell-box touching-light", "bounces that hit lamps count in full, as does NEE", "direct and indirect too bright") \
    X(nee_lost_weight, "area-light cornell-box", "MIS weight at NEE, lamps hit by bounces dropped", "direct too dark where p_bounce matters") \
    X(weights_swapped, "area-light cornell-box", "the two MIS weights exchanged", "direct wrong: shares exchanged") \
    X(pdf_by_area, "cornell-box area-light", "the light's density by area in the bounce's MIS weight", "direct wrong: weights do not sum to 1") \
    X(choice_not_in_pdf, "many-lights occluded-lights", "p_i left out of the bounce's MIS weight", "direct wrong: weights do not sum to 1") \
    X(power_and_balance, "cornell-box area-light", "power at NEE, balance at the bounce", "direct wrong: weights do not sum to 1") \
    X(delta_weighed, "mirror-light glass-ball", "MIS weight for lamps met after a mirror, pdf 1", "light met in mirrors too dark") \
    X(roulette_free, "furnace cornell-box", "roulette without dividing", "late bounces too dark") \
    X(roulette_half, "furnace cornell-box", "stops with .5, divides by the throughput's survival", "late bounces wrong") \
    X(roulette_all_free, "cornell-box furnace", "roulette from the first bounce, not divided", "indirect too dark") \
    X(throughput_cut, "furnace cornell-box", "paths of a throughput below .3 end", "late bounces missing") \
    X(roulette_twice, "furnace leaving-paths", "divided by q twice", "late bounces too bright") \
    X(roulette_mean, "furnace cornell-box", "survives by the mean, divides by the largest", "late bounces too dark") \
    X(depth_less, "cornell-box furnace", "one bounce too few", "last path length missing") \
    X(depth_more, "cornell-box many-lights", "one bounce too many", "one more path length") \
    X(depth_2, "cornell-box furnace", "direct light only", "indirect x 0") \
    X(depth_3, "cornell-box glass-ball", "no more than one bounce", "paths beyond 3 missing") \
    X(indirect_doubled, "cornell-box", "indirect light times 2", "indirect x 2") \
    X(indirect_half, "furnace cornell-box", "uniform bounce without its 2: throughput x .5 each bounce", "each bounce x .5") \
    X(uniform_as_cosine, "furnace cornell-box", "uniform directions weighed as cosine-weighted", "bounces: another distribution") \
    X(cosine_extra, "cornell-box furnace", "cosine-weighted directions, weighed by 2 cos", "bounces: another distribution") \
    X(whole_sphere_bounce, "furnace cornell-box", "bounces over the sphere, half of them lost", "each bounce about x .5") \
    X(half_turn, "cornell-box leaving-paths", "phi in [0, pi)", "bounces: one half only") \
    X(theta_uniform, "cornell-box leaving-paths", "theta = u pi / 2", "bounces: another distribution") \
    X(bounce_along_normal, "cornell-box", "directions in the world's axes about y, flipped above", "bounces: another distribution") \
    X(throughput_white, "cornell-box glass-ball", "albedo not in the throughput", "indirect too bright, uncoloured") \
    X(throughput_max, "cornell-box", "the largest channel of the albedo in the throughput", "indirect too bright, uncoloured") \
    X(first_colour, "cornell-box", "the first albedo for all bounces", "indirect: wrong colours") \
    X(throughput_clamped, "cornell-box glass-ball", "throughput cut at .5", "indirect too dark") \
    X(indirect_clamped, "cornell-box glass-ball", "indirect light of a sample cut at .3", "indirect: bright samples clamped") \
    X(mirror_cosine, "mirror-light mirror-corridor", "mirror times the cosine", "mirrored light x cos") \
    X(mirror_white, "mirror-light mirror-corridor", "the mirror's reflectance ignored", "mirrored light x 1/r each") \
    X(mirror_squared, "mirror-light mirror-corridor", "the mirror's reflectance twice", "mirrored light x r each") \
    X(mirror_through, "mirror-light", "the ray goes on straight through", "mirrored light: another scene seen") \
    X(mirror_back, "mirror-light", "reflects to where it came from", "mirrored light: another scene seen") \
    X(mirror_rough, "mirror-light", "blurs the mirrored ray by .05", "mirrored light: blurred") \
    X(metal_schlick, "metal", "Schlick from the reflectance at the normal", "mirrored light: edges wrong") \
    X(metal_green, "metal", "green eta and k for all channels", "mirrored light: colours wrong") \
    X(metal_no_k, "metal", "k ignored", "mirrored light too dark") \
    X(metal_no_angle, "metal", "reflectance at the normal for all angles", "mirrored light: edges too dark") \
    X(metal_squared, "metal", "Fresnel twice", "mirrored light x F") \
    X(glass_no_fresnel, "glass-ball glass-pane", "always refracts", "reflection missing") \
    X(glass_eta_inverted, "glass-ball glass-pane", "eta inverted", "refraction another") \
    X(glass_tir_black, "glass-ball", "total reflection absorbed", "total reflection missing") \
    X(glass_tir_straight, "glass-ball", "total reflection goes straight on", "total reflection missing") \
    X(glass_fresnel_twice, "glass-ball glass-pane", "chosen by F and multiplied by F", "glass too dark") \
    X(glass_coin, "glass-pane mixed-material", "chosen by a coin, not weighed", "glass: shares wrong") \
    X(glass_r0, "glass-ball glass-pane", "R0 for all angles", "glass: edges wrong") \
    X(glass_wrong_cosine, "glass-ball", "Schlick with the inner cosine on both sides", "glass: edges wrong") \
    X(glass_grey, "glass-ball glass-pane", "each crossing times .95", "glass: transmitted too dark") \
    X(glass_always_mirror, "glass-pane glass-ball", "glass reflects only", "transmission missing") \
    X(glass_eta_13, "glass-ball", "index 1.33 for all glass", "refraction another") \
    X(glass_eta_squared_out, "mixed-material", "no eta^2 at the boundary", "light refracted: x 2.25 missing") \
    X(glass_shadowless, "glass-ball lecture", "glass casts no shadow", "direct: through glass") \
    X(blend_swapped, "mixed-material", "weights exchanged (quarters)", "mixed material: shares wrong") \
    X(blend_weight_twice, "mixed-material", "chosen by the weight and multiplied by it", "reflected light x share of each part") \
    X(blend_first_only, "mixed-material", "first part only", "mixed material: the diffuse part alone") \
    X(offset_large, "cornell-box touching-light", "all rays start .05 off", "other: contact gaps") \
    X(inside_unhit, "inside-light furnace", "spheres are not met from inside", "spheres missing from inside") \
    X(inward_ignored, "inside-light furnace", "a sphere's normal always outwards", "inward spheres dark") \
    X(back_faces_lit, "mesh-room cornell-box light-below-horizon", "one-sided surfaces reflect on the back, too", "backs not black") \
    X(disk_as_square, "lecture", "a disk is met as a square", "other: a shape wrong") \
    X(sphere_shrunk, "lecture furnace spherical-light", "spheres 2 % too small", "other: a shape wrong") \
    X(flat_shading, "smooth-mesh", "vertex normals ignored", "other: facets") \
    X(triangle_no_half, "mesh-light", "the area of a triangle without 1/2", "direct x 2") \
    X(triangle_folded, "mesh-light", "u + v > 1 not folded back: half the samples beyond", "direct: of larger triangles") \
    X(triangle_clump, "mesh-light", "barycentric u, v (1 - u)", "direct: points crowd at a corner") \
    X(ambient, "cornell-box area-light", "an ambient term of .05 albedo", "other: .05 albedo added at the first vertex")

enum Mistake { none,
#define X(name, scenes, words, truth) name,
    MISTAKES(X)
#undef X
};
static const struct { const char *name, *scenes, *words, *truth; } table[] = {{"none", "", "", ""},
#define X(name, scenes, words, truth) {#name, scenes, words, truth},
    MISTAKES(X)
#undef X
};
static Mistake made = none;
static inline bool is(Mistake m) { return made == m; }

struct V {
    double x = 0, y = 0, z = 0;
    double &operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
    double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};
static V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static V operator*(V a, V b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
static V operator*(V a, double s) { return {a.x * s, a.y * s, a.z * s}; }
static V operator-(V a) { return a * -1.0; }
static double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static double length(V a) { return std::sqrt(dot(a, a)); }
static V unit(V a) { return a * (1 / length(a)); }
static double most(V a) { return std::max(a.x, std::max(a.y, a.z)); }
static double mean(V a) { return (a.x + a.y + a.z) / 3; }
static double luminance(V a) { return 0.2126 * a.x + 0.7152 * a.y + 0.0722 * a.z; }
template <class F> static V each(V a, F f) { return {f(a.x), f(a.y), f(a.z)}; }
static V grey(double a) { return {a, a, a}; }
static V cut(V a, double at) { return each(a, [at](double x) { return std::min(x, at); }); }
static const double PI = 3.14159265358979323846, FAR = 1e30;

/* JSON, as much as a scene needs. */
struct Json {
    double number = 0;
    bool truth = false;
    std::string text;
    std::vector<Json> list;
    std::map<std::string, Json> map;
    const Json &operator[](const std::string &key) const { return map.at(key); }
    bool has(const std::string &key) const { return map.count(key) > 0; }
    V vec() const { return {list.at(0).number, list.at(1).number, list.at(2).number}; }
};
static void skip(std::istream &in, char wanted)
{
    char c = 0;
    if (!(in >> c) || c != wanted)
        throw std::runtime_error(std::string("the scene is no JSON: wanted ") + wanted);
}
static Json read(std::istream &in)
{
    Json j;
    in >> std::ws;
    int c = in.peek();
    if (c == '{' || c == '[') {
        char close = c == '{' ? '}' : ']', next = 0;
        in.get();
        in >> std::ws;
        if (in.peek() == close)
            return in.get(), j;
        do {
            if (c == '{') {
                std::string key = read(in).text;
                skip(in, ':');
                j.map[key] = read(in);
            } else
                j.list.push_back(read(in));
            in >> next;
        } while (next == ',');
    } else if (c == '"') {
        in.get();
        std::getline(in, j.text, '"');
    } else if (c == 't' || c == 'f') {
        j.truth = c == 't';
        while (std::isalpha(in.peek()))
            in.get();
    } else
        in >> j.number;
    return j;
}

/* PCG, O'Neill 2014. */
struct Random {
    uint64_t state;
    explicit Random(uint64_t seed) : state(seed * 0x9E3779B97F4A7C15u + 0x632BE59BD9B4E019u) { u(), u(); }
    double u()
    {
        state = state * 6364136223846793005u + 1442695040888963407u;
        uint32_t x = (uint32_t)(((state >> 18) ^ state) >> 27), r = (uint32_t)(state >> 59);
        return (x >> r | x << (-r & 31)) * (1 / 4294967296.0);
    }
};

enum Kind { PARALLELOGRAM, DISK, SPHERE, TRIANGLE };
struct Primitive {
    Kind kind;
    V a, u, v, n, L, normals[3];
    double radius = 0, area = 0;
    bool inward = false, smooth = false;
    int material = 0;
};
struct Material {
    std::string type;
    bool two_sided = false;
    V reflectance, eta, k, transmittance;
    double index = 1, weight = 0;
    std::vector<Material> parts;
};
struct Light { /* a primitive, the sky, or one of no extent */
    int primitive = -1;
    std::string type;
    V position, axis, power;
    double cutoff = 0, beam = 0;
};
struct Hit {
    double t = FAR;
    int primitive = -1;
    V p, n, face;
};
struct Scene {
    int depth = 0, roulette = 0, width = 0, height = 0;
    V origin, corner[4], sky;
    std::vector<Primitive> primitives;
    std::vector<Material> materials;
    std::vector<Light> lights;
    std::vector<double> share; /* of the lights' power */
};

static V decoded(V a)
{
    if (is(albedo_halved))
        return a * 0.5;
    if (is(albedo_srgb))
        return each(a, [](double x) { return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4); });
    if (is(albedo_inverted))
        return grey(1) - a;
    return is(albedo_at_most_half) ? cut(a, 0.5) : a;
}

static Material material_of(const Json &j)
{
    Material m;
    m.type = j["type"].text;
    m.two_sided = j["two_sided"].truth || is(back_faces_lit);
    if (j.has("reflectance"))
        m.reflectance = m.type == "diffuse" ? decoded(j["reflectance"].vec()) : j["reflectance"].vec();
    if (m.type == "conductor")
        m.eta = j["eta"].vec(), m.k = j["k"].vec();
    if (m.type == "conductor" && is(metal_green))
        m.eta = grey(m.eta.y), m.k = grey(m.k.y);
    if (is(metal_no_k))
        m.k = grey(0);
    if (m.type == "dielectric") {
        m.transmittance = j["transmittance"].vec();
        m.index = j["eta"].number;
        if (is(glass_eta_inverted))
            m.index = 1 / m.index;
        if (is(glass_eta_13))
            m.index = m.index > 1 ? 1.33 : 1 / 1.33;
    }
    if (m.type == "blend") {
        m.weight = j["weight_of_second"].number;
        for (const Json &part : j["parts"].list)
            m.parts.push_back(material_of(part));
    }
    if (m.type != "blend" && m.type != "diffuse" && m.type != "mirror" && m.type != "conductor" && m.type != "dielectric")
        throw std::invalid_argument("no such material here: " + m.type);
    return m;
}

static Primitive primitive_of(const Json &j)
{
    Primitive p;
    std::string type = j["type"].text;
    p.material = (int)j["material"].number;
    p.L = j["radiance"].vec();
    if (type == "sphere") {
        p.kind = SPHERE, p.a = j["center"].vec(), p.radius = j["radius"].number, p.inward = j["inward"].truth;
        p.area = 4 * PI * p.radius * p.radius;
        p.radius *= is(sphere_shrunk) ? 0.98 : 1;
        p.area *= is(sphere_r_cubed) ? p.radius / 3 : is(sphere_disk_area) ? 0.25 : is(sphere_half_area) ? 0.5 : 1;
        p.inward = p.inward && !is(inward_ignored);
        return p;
    }
    p.n = j["normal"].vec();
    if (type == "triangle") {
        const std::vector<Json> &corners = j["vertices"].list;
        p.kind = TRIANGLE, p.a = corners[0].vec(), p.u = corners[1].vec() - p.a, p.v = corners[2].vec() - p.a;
        p.area = length(cross(p.u, p.v)) * (is(triangle_no_half) ? 1 : 0.5);
        p.smooth = j.has("vertex_normals") && !is(flat_shading);
        for (int i = 0; i < 3 && p.smooth; i++)
            p.normals[i] = j["vertex_normals"].list[i].vec();
    } else {
        p.kind = type == "disk" ? DISK : PARALLELOGRAM;
        p.a = j[type == "disk" ? "center" : "corner"].vec();
        p.u = j[type == "disk" ? "axis_u" : "edge_u"].vec();
        p.v = j[type == "disk" ? "axis_v" : "edge_v"].vec();
        p.area = length(cross(p.u, p.v)) * (type == "disk" ? PI : 1);
    }
    return p;
}

static Scene scene_of(const Json &j)
{
    Scene s;
    const Json &camera = j["camera"];
    const char *names[] = {"top_left", "top_right", "bottom_left", "bottom_right"};
    s.depth = j["max_depth"].number < 0 ? 1000 : (int)j["max_depth"].number;
    s.depth += is(depth_more) - is(depth_less);
    s.depth = is(depth_2) ? 2 : is(depth_3) ? std::min(s.depth, 3) : s.depth;
    s.roulette = is(roulette_all_free) ? 1 : (int)j["roulette_depth"].number;
    s.width = (int)camera["width"].number, s.height = (int)camera["height"].number;
    s.origin = camera["origin"].vec();
    for (int i = 0; i < 4; i++)
        s.corner[i] = camera[names[i]].vec();
    s.sky = j["sky"].vec();
    for (const Json &m : j["materials"].list)
        s.materials.push_back(material_of(m));
    for (const Json &p : j["primitives"].list) {
        s.primitives.push_back(primitive_of(p));
        if (most(s.primitives.back().L) > 0) {
            Light light;
            light.primitive = (int)s.primitives.size() - 1;
            s.lights.push_back(light);
            s.share.push_back(luminance(s.primitives.back().L) * s.primitives.back().area);
        }
    }
    for (const Json &l : j["lights"].list) {
        Light light;
        light.type = l["type"].text;
        bool sun = light.type == "sun";
        light.power = l[sun ? "irradiance" : "intensity"].vec();
        light.position = sun ? V() : l["position"].vec();
        light.axis = sun ? l["direction"].vec() : l.has("axis") ? l["axis"].vec() : V();
        if (l.has("cutoff_radians"))
            light.cutoff = l["cutoff_radians"].number, light.beam = l["beam_radians"].number;
        s.lights.push_back(light);
        s.share.push_back(luminance(light.power));
    }
    if (most(s.sky) > 0) {
        Light light;
        light.type = "sky";
        s.lights.push_back(light);
        s.share.push_back(luminance(s.sky));
    }
    if (is(first_light_skipped) && s.lights.size() > 1)
        s.lights.erase(s.lights.begin()), s.share.erase(s.share.begin());
    double sum = 0;
    for (double x : s.share)
        sum += x;
    for (double &x : s.share)
        x /= sum;
    return s;
}

/* The distance along o + t d to a primitive, beyond `least`; b and c are its coordinates where it is a triangle. */
static double meets(const Primitive &p, V o, V d, double least, double *b, double *c)
{
    if (p.kind == SPHERE) {
        V oc = o - p.a;
        double h = dot(oc, d);
        V foot = oc - d * h;
        double q = p.radius * p.radius - dot(foot, foot), root = std::sqrt(std::max(q, 0.0));
        if (q < 0)
            return FAR;
        if (-h - root > least)
            return -h - root;
        return -h + root > least && !is(inside_unhit) ? -h + root : FAR;
    }
    V n = cross(p.u, p.v);
    double slope = dot(n, d);
    if (slope == 0)
        return FAR;
    double t = dot(n, p.a - o) / slope;
    if (!(t > least))
        return FAR;
    V q = o + d * t - p.a;
    double nn = dot(n, n);
    *b = dot(cross(q, p.v), n) / nn, *c = dot(cross(p.u, q), n) / nn;
    bool within = *b >= 0 && *c >= 0 && (p.kind == TRIANGLE ? *b + *c <= 1 : *b <= 1 && *c <= 1);
    if (p.kind == DISK)
        within = is(disk_as_square) ? std::fabs(*b) <= 1 && std::fabs(*c) <= 1 : *b * *b + *c * *c <= 1;
    return within ? t : FAR;
}

static double offset() { return is(offset_large) ? 0.05 : 1e-6; }

static Hit nearest(const Scene &s, V o, V d)
{
    Hit hit;
    double b = 0, c = 0, at_b = 0, at_c = 0;
    for (size_t i = 0; i < s.primitives.size(); i++) {
        double t = meets(s.primitives[i], o, d, offset(), &b, &c);
        if (t < hit.t)
            hit.t = t, hit.primitive = (int)i, at_b = b, at_c = c;
    }
    if (hit.primitive < 0)
        return hit;
    const Primitive &p = s.primitives[hit.primitive];
    hit.p = o + d * hit.t;
    hit.face = p.kind == SPHERE ? unit(hit.p - p.a) * (p.inward ? -1 : 1) : p.n;
    hit.n = p.smooth ? unit(p.normals[0] * (1 - at_b - at_c) + p.normals[1] * at_b + p.normals[2] * at_c) : hit.face;
    return hit;
}

static bool blocked(const Scene &s, V o, V d, double distance, int target)
{
    double b, c, least = is(shadow_starts_late) ? 0.1 : offset();
    double end = is(shadow_endless) ? FAR : is(shadow_short) ? distance * 0.9 : distance * (1 - 1e-6);
    for (size_t i = 0; i < s.primitives.size(); i++) {
        const Primitive &p = s.primitives[i];
        if ((is(shadow_endless) && (int)i == target) || (is(lamps_cast_no_shadow) && most(p.L) > 0)
            || (is(spheres_cast_no_shadow) && p.kind == SPHERE)
            || (is(glass_shadowless) && s.materials[p.material].type == "dielectric"))
            continue;
        if (meets(p, o, d, least, &b, &c) < end)
            return true;
    }
    return false;
}

static void frame(V n, V *s, V *t)
{
    *s = unit(std::fabs(n.x) > 0.6 ? cross(n, {0, 1, 0}) : cross(n, {1, 0, 0}));
    *t = cross(n, *s);
}
static V around(V n, double z, double turn)
{
    V s, t;
    double r = std::sqrt(std::max(0.0, 1 - z * z));
    frame(n, &s, &t);
    return s * (r * std::cos(2 * PI * turn)) + t * (r * std::sin(2 * PI * turn)) + n * z;
}

/* A point of a lamp, uniform by area, and its normal. */
static void point_of(const Primitive &p, Random &r, V *point, V *n)
{
    double u = r.u(), v = r.u();
    if (is(light_middle))
        u = v = p.kind == PARALLELOGRAM ? 0.5 : 0.25;
    if (is(light_diagonal))
        v = u;
    if (is(light_corner_dense))
        u *= u;
    if (is(light_quarter))
        u *= 0.5, v *= 0.5;
    *n = p.n;
    if (p.kind == SPHERE) {
        V outward = around({0, 0, 1}, is(sphere_theta_uniform) ? std::cos(PI * u) : 1 - 2 * u, v);
        *point = p.a + outward * p.radius;
        *n = outward * (p.inward ? -1 : 1);
    } else if (p.kind == DISK)
        *point = p.a + p.u * (std::sqrt(u) * std::cos(2 * PI * v)) + p.v * (std::sqrt(u) * std::sin(2 * PI * v));
    else if (p.kind == TRIANGLE && is(triangle_clump))
        *point = p.a + p.u * u + p.v * (v * (1 - u));
    else {
        if (p.kind == TRIANGLE && u + v > 1 && !is(triangle_folded))
            u = 1 - u, v = 1 - v;
        *point = p.a + p.u * u + p.v * v;
    }
}

/* The share of a spot's intensity towards d. */
static double falloff(const Light &light, V d)
{
    double angle = std::acos(std::min(1.0, dot(d, light.axis))), half = is(spot_half_angle) ? 0.5 : 1;
    double cutoff = light.cutoff * half, beam = light.beam * half;
    double x = std::min(1.0, std::max(0.0, (cutoff - angle) / (cutoff - beam)));
    if (is(spot_cosine_ramp))
        x = std::min(1.0, std::max(0.0, (std::cos(angle) - std::cos(cutoff)) / (std::cos(beam) - std::cos(cutoff))));
    return is(spot_hard) ? x > 0 : is(spot_smooth) ? x * x * (3 - 2 * x) : is(spot_squared) ? x * x : x;
}

/* The density by solid angle of a sample of light i, given where it lies on it. */
static double pdf_light(const Scene &s, const Light &light, double distance, double cosine)
{
    double area = light.type == "sky" ? 0 : s.primitives[light.primitive].area;
    return area > 0 ? distance * distance / (area * cosine) : 1 / (2 * PI);
}

/* One ray to one light: what f_r cos gets of it, with the balance heuristic against bounces of density cos/pi. */
static V sample_lights(const Scene &s, const Hit &hit, V n, V albedo, Random &r)
{
    size_t count = s.lights.size();
    if (!count)
        return {};
    size_t i = std::min(count - 1, (size_t)(r.u() * (double)(is(last_never) && count > 1 ? count - 1 : count)));
    double over_p = (double)count;
    if (is(first_always))
        i = 0;
    if (is(power_choice_uniform_weight)) {
        double u = r.u();
        for (i = 0; i + 1 < count && u >= s.share[i]; i++)
            u -= s.share[i];
    }
    over_p = is(choice_forgotten) ? 1 : is(choice_twice) ? over_p * over_p : is(one_light_only) ? over_p - 1 : over_p;
    const Light &light = s.lights[i];
    V wi, L = light.power;
    double distance = FAR, over_pdf = 1, weight = 1, cosine;
    if (light.primitive >= 0) {
        const Primitive &p = s.primitives[light.primitive];
        V point, light_n;
        point_of(p, r, &point, &light_n);
        L = is(light_red) ? grey(p.L.x) : p.L;
        V to = point - hit.p;
        distance = length(to), wi = to * (1 / distance);
        double shines = -dot(light_n, wi), dd = distance * distance;
        bool as_point = is(sphere_as_point) && p.kind == SPHERE;
        if (as_point) {
            to = p.a - hit.p, wi = unit(to), dd = dot(to, to), distance = std::sqrt(dd) - p.radius * 1.001;
            over_pdf = PI * p.radius * p.radius / dd;
        } else {
            if (both_sides_shine == made)
                shines = std::fabs(shines);
            if (!(shines > 0))
                return {};
            double pdf = pdf_light(s, light, distance, shines), at = std::max(dot(n, wi), 0.0) / PI * over_p;
            double ratio = at / pdf;
            weight = is(power_and_balance) ? 1 / (1 + ratio * ratio) : 1 / (1 + ratio);
            if (is(weights_swapped))
                weight = 1 - weight;
            if (is(double_count))
                weight = 1;
            double area = is(no_area) ? 1 : is(area_twice) ? p.area * p.area : is(quarter_area) ? p.area / 4 : p.area;
            double c = is(no_light_cosine) || (is(sphere_no_cosine) && p.kind == SPHERE) ? 1
                : is(light_cosine_twice) ? shines * shines : shines;
            over_pdf = area * c / (is(one_over_d) ? distance : is(no_distance) ? 1 : dd);
        }
        if (is(light_middle) || as_point)
            weight = 1;
    } else if (light.type == "sky") {
        wi = around(n, r.u(), r.u()), L = s.sky;
        if (is(sky_upper_half) && wi.z <= 0)
            L = grey(0);
        over_pdf = is(sky_4pi) ? 4 * PI : 2 * PI;
        weight = is(sky_twice) ? 1 : 1 / (1 + dot(n, wi) / PI * 2 * PI * over_p);
    } else if (light.type == "sun") {
        wi = light.axis * (is(sun_backwards) ? 1 : -1);
        L = L * (is(sun_over_pi) ? 1 / PI : 1);
    } else {
        V to = light.position - hit.p;
        distance = length(to), wi = to * (1 / distance);
        double dd = distance * distance;
        over_pdf = is(one_over_d) ? 1 / distance : is(no_distance) ? 1 : is(d_cubed) ? 1 / (dd * distance)
            : is(d_plus_1) ? 1 / (1 + dd) : 1 / dd;
        if (light.type == "spot light")
            over_pdf *= falloff(light, -wi) * (is(spot_no_distance) ? dd : 1);
        else
            over_pdf *= is(point_flux) ? 1 / (4 * PI) : is(point_pi) ? PI : 1;
    }
    cosine = dot(n, wi);
    if (is(back_lit))
        cosine = std::fabs(cosine);
    if (!(cosine > 0))
        return {};
    bool sun = light.type == "sun";
    double reach = sun && is(sun_distance_1) ? 1 : distance;
    bool free = is(no_shadows) || (sun && is(sun_no_shadow)) || (light.type == "sky" && is(sky_no_shadow));
    if (!free && blocked(s, hit.p, wi, reach, light.primitive))
        return {};
    double c = is(no_cosine) || (sun && is(sun_no_cosine)) ? 1 : is(cosine_twice) ? cosine * cosine
        : is(cosine_root) ? std::sqrt(cosine) : cosine;
    double over = is(no_pi) ? 1 : is(two_pi) ? 2 * PI : is(pi_twice) ? PI * PI : PI;
    V f = is(albedo_squared) ? albedo * albedo : is(albedo_ignored) ? grey(1) : albedo;
    return L * f * (c * over_pdf * over_p * weight / over);
}

static double fresnel_metal(double c, double eta, double k)
{
    double cc = c * c, ss = 1 - cc, q = eta * eta - k * k - ss, ab = std::sqrt(q * q + 4 * eta * eta * k * k);
    double a = std::sqrt(std::max(0.0, (ab + q) / 2));
    double rs = (ab - 2 * a * c + cc) / (ab + 2 * a * c + cc);
    return rs * (1 + (ab * cc - 2 * a * c * ss + ss * ss) / (ab * cc + 2 * a * c * ss + ss * ss)) / 2;
}
static V metal(const Material &m, double c)
{
    V result;
    for (int i = 0; i < 3; i++) {
        double f = fresnel_metal(is(metal_no_angle) ? 1 : c, m.eta[i], m.k[i]);
        double f0 = fresnel_metal(1, m.eta[i], m.k[i]);
        result[i] = is(metal_schlick) ? f0 + (1 - f0) * std::pow(1 - c, 5) : is(metal_squared) ? f * f : f;
    }
    return result * m.reflectance;
}

/* Glass: the direction that a ray goes on by, and its weight. ratio: the index here over the one beyond. */
static V through_glass(const Material &m, V d, V n, bool front, Random &r, V *weight)
{
    double ratio = front ? 1 / m.index : m.index, c = -dot(d, n), q = 1 - ratio * ratio * (1 - c * c);
    V mirrored = d + n * (2 * c);
    *weight = m.reflectance;
    if (q <= 0) {
        if (is(glass_tir_black))
            *weight = grey(0);
        return is(glass_tir_straight) ? d : mirrored;
    }
    double ct = std::sqrt(q), s = (ratio * c - ct) / (ratio * c + ct), p = (ratio * ct - c) / (ratio * ct + c);
    double r0 = std::pow((ratio - 1) / (ratio + 1), 2), f = (s * s + p * p) / 2;
    if (is(glass_wrong_cosine))
        f = r0 + (1 - r0) * std::pow(1 - (front ? ct : c), 5);
    f = is(glass_no_fresnel) ? 0 : is(glass_coin) ? 0.5 : is(glass_r0) ? r0 : is(glass_always_mirror) ? 1 : f;
    bool reflects = r.u() < f;
    if (is(glass_fresnel_twice))
        *weight = *weight * (reflects ? f : 1 - f);
    if (reflects)
        return mirrored;
    *weight = m.transmittance * (is(glass_eta_squared_out) ? 1 : ratio * ratio) * (is(glass_grey) ? 0.95 : 1)
        * (is(glass_fresnel_twice) ? 1 - f : 1);
    return unit(d * ratio + n * (ratio * c - ct));
}

static const Material &leaf_of(const Material &m, Random &r, double *share)
{
    if (m.type != "blend")
        return m;
    double weight = is(blend_swapped) && m.parts[0].type == "diffuse" ? 0.25 : m.weight;
    bool second = r.u() < weight && !is(blend_first_only);
    *share *= second ? weight : 1 - weight;
    return leaf_of(m.parts[second], r, share);
}

/* A bounce over the hemisphere by the cosine; what its weight is besides the albedo. */
static V bounce(V n, Random &r, double *weight)
{
    double u = r.u(), v = r.u();
    *weight = is(indirect_half) ? 0.5 : 1;
    if (is(uniform_as_cosine))
        return around(n, u, v);
    if (is(whole_sphere_bounce) && r.u() < 0.5)
        *weight = 0;
    if (is(theta_uniform))
        return around(n, std::cos(u * PI / 2), v);
    if (is(half_turn))
        v *= 0.5;
    if (is(bounce_along_normal)) {
        V wi = around({0, 1, 0}, std::sqrt(u), v);
        return dot(wi, n) > 0 ? wi : -wi;
    }
    V wi = around(n, std::sqrt(u), v);
    if (is(cosine_extra))
        *weight = 2 * dot(wi, n);
    return wi;
}

/* How much of the lamp that a bounce of density pdf has met counts. */
static double weight_of_met(const Scene &s, const Light &light, double pdf, double distance, double cosine)
{
    double count = (double)s.lights.size(), other = pdf_light(s, light, distance, cosine) / count;
    if (is(pdf_by_area))
        other = 1 / s.primitives[std::max(light.primitive, 0)].area / count;
    if (is(choice_not_in_pdf))
        other *= count;
    if (is(nee_lost_weight) || is(light_middle) || is(sphere_as_point))
        return 0;
    if (is(double_count) || (is(sky_twice) && light.type == "sky"))
        return 1;
    return is(weights_swapped) ? other / (pdf + other) : pdf / (pdf + other);
}

static V trace(const Scene &s, V o, V d, Random &r)
{
    V L, T = grey(1), first, colour;
    double pdf = 0, bounces = 0;
    bool met_all = true; /* no ray to a light went this way */
    for (int depth = 1;; depth++) {
        Hit hit = nearest(s, o, d);
        if (hit.primitive < 0) {
            bool lost = (is(sky_unseen) && depth == 1) || (is(sky_never_met) && !met_all) || (is(sky_upper_half) && d.z <= 0);
            Light sky;
            sky.type = "sky";
            if (!lost && most(s.sky) > 0)
                L = L + T * s.sky * (met_all ? 1 : weight_of_met(s, sky, pdf, 1, 1));
            break;
        }
        const Primitive &p = s.primitives[hit.primitive];
        double cosine = -dot(hit.face, d);
        bool front = cosine > 0;
        if (front && most(p.L) > 0) {
            Light lamp;
            lamp.primitive = hit.primitive;
            double weight = met_all ? 1 : weight_of_met(s, lamp, pdf, hit.t, cosine);
            if (is(delta_weighed) && met_all && depth > 1)
                weight = weight_of_met(s, lamp, 1, hit.t, cosine);
            if ((is(lamps_unseen) && depth == 1) || (is(lamps_in_mirrors_lost) && depth > 1 && met_all))
                weight = 0;
            if (is(lamps_double) && depth == 1)
                weight = 2;
            L = L + T * (is(lamps_clamped) && depth == 1 ? cut(p.L, 1) : p.L) * weight;
        }
        if (depth == 1)
            first = L;
        if (depth >= s.depth)
            break;
        double share = 1, shading = -dot(hit.n, d), weight = 1;
        const Material &top = s.materials[p.material], &m = leaf_of(top, r, &share);
        V n = shading > 0 ? hit.n : -hit.n, factor;
        if (!(shading > 0) && !top.two_sided && !m.two_sided && m.type != "dielectric")
            break;
        if (is(blend_weight_twice))
            T = T * share;
        met_all = m.type != "diffuse";
        if (m.type == "diffuse") {
            V direct = sample_lights(s, hit, n, m.reflectance, r) * T;
            L = L + direct;
            if (is(ambient) && depth == 1)
                L = L + m.reflectance * 0.05;
            V wi = bounce(n, r, &weight);
            if (bounces++ == 0)
                colour = m.reflectance;
            factor = is(throughput_white) ? grey(1) : is(throughput_max) ? grey(most(m.reflectance))
                : is(first_colour) ? colour : m.reflectance;
            pdf = std::max(dot(n, wi), 1e-9) / PI;
            d = wi;
            if (depth == 1)
                first = L;
        } else if (m.type == "dielectric")
            d = through_glass(m, d, n, shading > 0, r, &factor);
        else {
            double c = std::fabs(shading);
            factor = m.type == "mirror" ? m.reflectance : metal(m, c);
            factor = is(mirror_white) ? grey(1) : is(mirror_squared) ? factor * factor : is(mirror_cosine) ? factor * c : factor;
            if (is(mirror_back))
                d = -d;
            else if (!is(mirror_through))
                d = d + n * (2 * c);
            if (is(mirror_rough))
                d = unit(d + around(n, 1 - 2 * r.u(), r.u()) * 0.05);
        }
        T = T * factor * weight;
        if (is(indirect_doubled) && depth == 1)
            T = T * 2;
        if (is(throughput_clamped))
            T = cut(T, 0.5);
        o = hit.p;
        if (!(most(T) > (is(throughput_cut) ? 0.3 : 0)))
            break;
        if (depth >= s.roulette) {
            double q = std::min(1.0, is(roulette_mean) ? mean(T) : most(T)), by = is(roulette_mean) ? std::min(1.0, most(T)) : q;
            if (r.u() >= (is(roulette_half) ? 0.5 : q))
                break;
            if (!is(roulette_free) && !is(roulette_all_free))
                T = T * (1 / (is(roulette_twice) ? by * by : by));
        }
    }
    return is(indirect_clamped) ? first + cut(L - first, 0.3) : L;
}

static V camera_direction(const Scene &s, double x, double y)
{
    double a = x / (is(endpoints_at_edges) ? s.width - 1 : s.width), b = y / (is(endpoints_at_edges) ? s.height - 1 : s.height);
    if (is(mirror_columns))
        a = 1 - a;
    if (is(wide_view) || is(zoomed)) {
        double by = is(wide_view) ? 1.05 : 1 / 1.02;
        a = 0.5 + (a - 0.5) * by, b = 0.5 + (b - 0.5) * by;
    }
    if (is(angles_interpolated)) {
        double half = std::acos(dot(unit(s.corner[0]), unit(s.corner[1]))) / 2;
        a = 0.5 + std::tan((2 * a - 1) * half) / std::tan(half) / 2, b = 0.5 + std::tan((2 * b - 1) * half) / std::tan(half) / 2;
    }
    return unit(s.corner[0] * ((1 - a) * (1 - b)) + s.corner[1] * (a * (1 - b)) + s.corner[2] * ((1 - a) * b) + s.corner[3] * (a * b));
}

static V sample_pixel(const Scene &s, int x, int y, Random &r)
{
    double u = r.u(), v = r.u(), by = PI * 2;
    if (is(half_pixel))
        u -= 0.5, v -= 0.5;
    if (is(half_pixel_down))
        v += 0.5;
    if (is(whole_pixel))
        u += 1, v += 1;
    if (is(pixel_middle) || is(pixel_corner))
        u = v = is(pixel_middle) ? 0.5 : 0;
    if (is(jitter_half))
        u *= 0.5, v *= 0.5;
    if (is(tent_filter))
        u = u + r.u() - 0.5, v = v + r.u() - 0.5;
    if (is(box_two))
        u = 2 * u - 0.5, v = 2 * v - 0.5;
    if (is(gauss_filter)) {
        double g = 0.5 * std::sqrt(-2 * std::log(1 - u));
        u = 0.5 + g * std::cos(by * v), v = 0.5 + g * std::sin(by * v);
    }
    V o = s.origin, d = camera_direction(s, x + u, y + v), middle = unit(s.corner[0] + s.corner[3]);
    V right = unit(s.corner[1] - s.corner[0]), down = unit(s.corner[2] - s.corner[0]);
    if (is(camera_aside))
        o = o + right * 0.03;
    if (is(depth_of_field)) {
        double a = 0.03 * std::sqrt(r.u()), turn = by * r.u();
        V lens = o + right * (a * std::cos(turn)) + down * (a * std::sin(turn));
        d = unit(o + d * (3 / dot(d, middle)) - lens), o = lens;
    }
    V L = trace(s, o, d, r);
    if (is(samples_clamped_1) || is(samples_clamped_half))
        L = cut(L, is(samples_clamped_1) ? 1 : 0.5);
    return is(vignette) ? L * std::pow(dot(d, middle), 4) : L;
}

static V rows_of(V a, const double m[3][3])
{
    V out;
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * a.x + m[i][1] * a.y + m[i][2] * a.z;
    return out;
}

/* What is done to a pixel's mean before it is written. */
static V developed(V a, int spp)
{
    static const double xyz[3][3] = {{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}};
    double y = luminance(a);
    switch (made) {
    case bgr: return {a.z, a.y, a.x};
    case gbr: return {a.y, a.z, a.x};
    case red_for_all: return grey(a.x);
    case luminance_only: return grey(y);
    case mean_grey: return grey(mean(a));
    case gamma_22: return each(a, [](double x) { return std::pow(x, 1 / 2.2); });
    case gamma_2: return each(a, [](double x) { return std::sqrt(x); });
    case gamma_inverse: return each(a, [](double x) { return std::pow(x, 2.2); });
    case srgb_written:
        return each(a, [](double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055; });
    case clamped_at_1: return cut(a, 1);
    case eight_bits: return each(cut(a, 1), [](double x) { return std::floor(x * 255 + 0.5) / 255; });
    case reinhard: return each(a, [](double x) { return x / (1 + x); });
    case exponential: return each(a, [](double x) { return 1 - std::exp(-x); });
    case log_tone: return each(a, [](double x) { return std::log(1 + x); });
    case filmic:
        return each(a, [](double x) { return std::min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)); });
    case exposure_2: return a * 2;
    case exposure_100: return a * 100;
    case divided_by_255: return a * (1 / 255.0);
    case one_sample_too_many: return a * (spp / (spp + 1.0));
    case sum_not_mean: return a * spp;
    case xyz_written: return rows_of(a, xyz);
    case saturated: return each(grey(y) + (a - grey(y)) * 1.3, [](double x) { return std::max(x, 0.0); });
    case sepia_half: return (a + grey(y)) * 0.5;
    case warm_white: return a * V{1.1, 1, 0.85};
    case blue_dimmed: return a * V{1, 1, 0.95};
    case black_level: return a + grey(0.01);
    default: return a;
    }
}

static void filter(std::vector<V> &film, int w, int h)
{
    std::vector<V> from = film;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            for (int c = 0; c < 3; c++) {
                std::vector<double> near;
                for (int j = std::max(0, y - 1); j <= std::min(h - 1, y + 1); j++)
                    for (int i = std::max(0, x - 1); i <= std::min(w - 1, x + 1); i++)
                        near.push_back(from[j * w + i][c]);
                double sum = 0;
                for (double one : near)
                    sum += one;
                std::sort(near.begin(), near.end());
                film[y * w + x][c] = is(blurred) ? sum / (double)near.size() : near[near.size() / 2];
            }
}

/* Where a pixel is written to. */
static size_t place(int x, int y, int w, int h)
{
    if (is(flip_rows) || is(rotated_half_turn))
        y = h - 1 - y;
    if (is(rotated_half_turn))
        x = w - 1 - x;
    if (is(transposed) || is(quarter_turn))
        std::swap(x, y);
    if (is(quarter_turn))
        x = w - 1 - x;
    return (size_t)(y * w + x);
}

static std::vector<V> render(const Scene &s, int spp, uint64_t seed)
{
    std::vector<V> film((size_t)(s.width * s.height));
    Random r(is(same_seed) ? 1 : seed);
    for (int y = 0; y < s.height; y++) {
        if (is(row_seed))
            r = Random(seed);
        for (int x = 0; x < s.width; x++) {
            V sum, brightest;
            for (int k = 0; k < spp; k++) {
                V L = sample_pixel(s, x, y, r);
                if (is(best_half) && k % 8 == 0)
                    brightest = L;
                if (is(best_half) && luminance(L) > luminance(brightest))
                    brightest = L;
                sum = sum + L;
                if (is(best_half) && k % 8 == 7)
                    sum = sum - brightest + (sum - brightest) * (1.0 / std::max(k, 1)) * (k == 7);
            }
            bool black = (is(last_row_black) && y == s.height - 1) || (is(last_column_black) && x == s.width - 1);
            film[place(x, y, s.width, s.height)] = black ? V() : developed(sum * (1.0 / spp), spp);
        }
    }
    if (is(blurred) || is(median_3x3))
        filter(film, s.width, s.height);
    return film;
}

static int write_pfm(const char *file, const std::vector<V> &film, int w, int h)
{
    FILE *out = std::fopen(file, "wb");
    if (!out)
        return std::perror(file), 2;
    std::fprintf(out, "PF\n%d %d\n-1\n", w, h);
    for (int y = h - 1; y >= 0; y--)
        for (int x = 0; x < w; x++) {
            V a = film[(size_t)(y * w + x)];
            float rgb[3] = {(float)a.x, (float)a.y, (float)a.z};
            std::fwrite(rgb, sizeof rgb, 1, out);
        }
    return std::fclose(out) ? 2 : 0;
}

int main(int argc, char **argv)
{
    int spp = 16;
    uint64_t seed = 0;
    const char *output = nullptr, *file = nullptr;
    for (int i = 1; i < argc; i++) {
        std::string option = argv[i], value = i + 1 < argc ? argv[i + 1] : "";
        if (option == "--list") {
            for (size_t k = 1; k < sizeof table / sizeof *table; k++)
                std::printf("%s\t%s\t%s\t%s\n", table[k].name, table[k].scenes, table[k].words, table[k].truth);
            return 0;
        }
        if (option == "--spp")
            spp = std::stoi(value), i++;
        else if (option == "--seed")
            seed = std::stoull(value), i++;
        else if (option == "-o")
            output = argv[++i];
        else if (option == "--mistake") {
            size_t k = 0;
            while (k < sizeof table / sizeof *table && value != table[k].name)
                k++;
            if (k == sizeof table / sizeof *table)
                return std::fprintf(stderr, "no such mistake: %s\n", value.c_str()), 2;
            made = (Mistake)k, i++;
        } else
            file = argv[i];
    }
    if (!file || !output)
        return std::fprintf(stderr, "renderer SCENE.json --spp N --seed S [--mistake NAME] -o OUT.pfm\n"), 2;
    std::ifstream in(file);
    try {
        Scene scene = scene_of(read(in));
        return write_pfm(output, render(scene, spp, seed), scene.width, scene.height);
    } catch (const std::invalid_argument &error) {
        return std::fprintf(stderr, "%s: %s\n", file, error.what()), 77;
    } catch (const std::exception &error) {
        return std::fprintf(stderr, "%s: %s\n", file, error.what()), 2;
    }
}
