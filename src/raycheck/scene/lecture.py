"""The lecture's argument for each technique, a sentence each: J. Bikker, INFOMAGR lecture 12, Probability
Theory, Utrecht 2021/22.
"""

ARGUMENTS = {
    "L1": "a point light of flux I gives a surface at distance d the irradiance I cosθ / (4π d²); an "
    "intensity in W/sr is I/(4π) already",
    "L2": "an area light is seen under the solid angle A cosθ_light / d², so a sample of it weighs L A "
    "cosθ_light cosθ / d²",
    "L3": "one ray to a random point of the light arrives or not: wrong each time, and right on average",
    "L4": "one of N lights, chosen with probability p_i, stands for all of them when it is divided by p_i: "
    "by N only if all are equally likely",
    "L5": "a point on the sphere has the pdf 1/(4πR²), on its facing half 1/(2πR²), in the cone that it "
    "fills 1/(2π(1 − cosθmax)) per solid angle: sampling and pdf must be of the same set",
    "L6": "lights known to be hidden may be skipped if the chances of the others then sum to 1",
    "L7": "what leaves a point is what it emits plus what it reflects, and the ray recurses",
    "L8": "one ray over the hemisphere stands for all 2π sr: f_r L cosθ · 2π",
    "L9": "a sample is divided by the pdf that it was drawn from: with cosθ/π the cosine and π cancel and "
    "the albedo is left",
    "L10": "direct and indirect light do not overlap: the light is sampled explicitly, and a random ray that"
    " hits it returns 0",
    "L11": "a mirror's BRDF is a delta: no explicit ray can sample it, so the reflected ray must accept the "
    "light that it hits",
    "L12": "the eye is a specular vertex: the light that the primary ray hits must be returned",
    "L13": "two ways to the same light are both used, with weights that sum to 1 for every direction",
    "L14": "a path that goes on with probability p is divided by p: E[1(u<p) X/p] = E[X]",
    "L15": "glass reflects with Fresnel's reflectance, else refracts; past the critical angle it reflects "
    "all",
    "L16": "of a mixed material one part is chosen with its share, diffuse = 1 − (refl + refr), and divided "
    "by it",
    "L17": "a path from the light carries flux, and each vertex is joined to the eye by f_r cosθ / (d² "
    "cos³θ_eye A_film)",
    "L18": "any pdf is valid, as long as it is not 0 where there is light, and the sample is divided by it",
    "L19": "paths end at max_depth vertices: 1 is emission only, 2 is direct light",
    "P1": "a rough metal is many small mirrors: f_r = F D G / (4 cosθi cosθo), with D the share of them "
    "whose normal is the half vector and G the share of those that is seen from both sides; rough glass "
    "refracts by them too, and radiance is compressed by η²; plastic is a diffuse base under a coat, "
    "smooth or of such mirrors",
    "P2": "a principled material is a sum of lobes with weights that its numbers give: a direction is taken "
    "by one of them, and its pdf is the sum over all",
    "P4": "a reflectance that is a texture is its value at the (u, v) of the point that the ray meets",
    "P5": "a sky that is a picture is sampled by what it is between its pixels, whose rows are narrower by "
    "sinθ",
    "sampling": "the mean of N samples is right and its error falls by √N only if they are independent",
    "film": "a pixel is the plain mean of its samples, in linear radiance: what is done to them afterwards, "
    "or to some of them, biases it",
    "camera": "a pixel is the mean over its own square of the film, row 0 at the top",
}


def argument(technique: str) -> str:
    """The argument for a technique such as "L10 next event estimation"."""
    return ARGUMENTS[technique.split()[0]]
