"""A small path tracer that knows of a scene only what `raycheck scene --as json` says: for comparisons.

It shares nothing with oneray: brute force instead of trees, lights by area, metals by their microfacets, no
multiple importance sampling. A surface whose light comes back from one direction, or nearly so, finds lamps
by chance, a diffuse one by a point on a lamp; the sky is found by chance always.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

Array = np.ndarray
AT_ONCE = 100_000
"""Rays times primitives that are met at a time."""
NO_LIMIT = 60
"""Segments of a path whose depth has no limit; roulette ends nearly all of them long before."""


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)


def _frame(n: Array) -> tuple[Array, Array]:
    """Two unit vectors (N, 3) across n (N, 3)."""
    helper = np.where(np.abs(n[:, :1]) > 0.6, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    u = _unit(np.cross(helper, n))
    return u, np.cross(n, u)


class Primitives:
    """Flat ones first: p = o + s u + t v, with s and t within a square, triangle or circle. Then others."""

    def __init__(self, data: dict[str, Any]):
        kinds = ("parallelogram", "triangle", "disk")
        flat = [p for kind in kinds for p in data["primitives"] if p["type"] == kind]
        balls = [p for p in data["primitives"] if p["type"] == "sphere"]
        tubes = [p for p in data["primitives"] if p["type"] == "cylinder"]
        self.all = flat + balls + tubes
        self.flats, self.tubes = len(flat), len(flat) + len(balls)
        self.ends = np.array([[p["p0"], p["p1"]] for p in tubes]).reshape(-1, 2, 3)
        self.height = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        self.axis = (self.ends[:, 1] - self.ends[:, 0]) / self.height[:, None]
        self.tube_axes = np.array([p.get("axes", np.eye(3)) for p in tubes]).reshape(-1, 3, 3)
        self.tube_radius = np.array([p["radius"] for p in tubes])
        self.tube_inward = np.array([p["inward"] for p in tubes], dtype=bool)
        placed = np.array([self._placed(p) for p in flat]).reshape(-1, 3, 3)
        self.o, self.u, self.v = placed[:, 0], placed[:, 1], placed[:, 2]
        self.kind = np.array([p["type"] for p in flat], dtype=str)
        ends = np.searchsorted([kinds.index(p["type"]) for p in flat], [0, 1, 2, 3])
        self.squares, self.triangles, self.disks = (slice(*ends[i : i + 2]) for i in range(3))
        self.normal = np.array([p["normal"] for p in flat]).reshape(-1, 3)
        self.smooth = np.array([p.get("vertex_normals", [p["normal"]] * 3) for p in flat]).reshape(-1, 3, 3)
        across = np.cross(self.u, self.v)
        size = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        self.plane = across / size
        self.dual_s, self.dual_t = np.cross(self.v, self.plane) / size, np.cross(self.plane, self.u) / size
        self.uv = np.array([p.get("uv", np.zeros((3, 3))) for p in flat]).reshape(-1, 3, 3)[..., :2]
        self.center = np.array([p["center"] for p in balls]).reshape(-1, 3)
        self.axes = np.array([p.get("axes", np.eye(3)) for p in balls]).reshape(-1, 3, 3)
        self.radius = np.array([p["radius"] for p in balls])
        self.inward = np.array([p["inward"] for p in balls], dtype=bool)
        self.radiance = np.array([p["radiance"] for p in self.all]).reshape(-1, 3)
        self.material = np.array([p["material"] for p in self.all], dtype=int)

    @staticmethod
    def _placed(p: dict[str, Any]) -> list[Any]:
        if p["type"] == "triangle":
            a, b, c = np.array(p["vertices"])
            return [a, b - a, c - a]
        if p["type"] == "disk":
            return [p["center"], p["axis_u"], p["axis_v"]]
        return [p["corner"], p["edge_u"], p["edge_v"]]

    def meet(
        self, o: Array, d: Array, start: Array, low: Any = 0.0, high: Any = np.inf, hidden: Any = None
    ) -> Any:
        """Of rays from o along d: which primitive each meets first beyond `low` (−1: none up to `high`), and
        how far away. `start` is the primitive that it leaves, `hidden` those that it passes.
        """
        chunk = max(1, AT_ONCE // max(1, len(self.all)))
        low, high = (np.broadcast_to(x, len(o)) for x in (low, high))
        found = np.full(len(o), -1)
        t = np.full(len(o), np.inf)
        for i in range(0, len(o), chunk) if self.all else ():
            part = slice(i, i + chunk)
            each = self._all(o[part], d[part], start[part], low[part, None])
            each[each > high[part, None]] = np.inf
            if hidden is not None:
                each[:, hidden] = np.inf
            found[part] = each.argmin(axis=1)
            t[part] = each.min(axis=1)
        found[~np.isfinite(t)] = -1
        return found, t

    def _all(self, o: Array, d: Array, start: Array, low: Array) -> Array:
        """(N, P)"""
        here = start[:, None] == np.arange(len(self.all))
        with np.errstate(all="ignore"):
            height = o @ self.plane.T - _dot(self.o, self.plane)
            flat = -height / (d @ self.plane.T)
            s = o @ self.dual_s.T - _dot(self.o, self.dual_s) + flat * (d @ self.dual_s.T)
            t = o @ self.dual_t.T - _dot(self.o, self.dual_t) + flat * (d @ self.dual_t.T)
            outside = ~(flat > low) | here[:, : self.flats]
            part = self.squares
            outside[:, part] |= ~((np.minimum(s, t)[:, part] >= 0) & (np.maximum(s, t)[:, part] <= 1))
            part = self.triangles
            outside[:, part] |= ~((np.minimum(s, t)[:, part] >= 0) & ((s + t)[:, part] <= 1))
            part = self.disks
            outside[:, part] |= ~(s[:, part] ** 2 + t[:, part] ** 2 <= 1)
            flat[outside] = np.inf
            between = self.center - o[:, None]
            middle = (between * d[:, None]).sum(axis=-1)
            beside = ((between - middle[..., None] * d[:, None]) ** 2).sum(axis=-1)
            half = np.sqrt(self.radius**2 - beside)
            near, far = middle - half, middle + half
            on = here[
                :, self.flats : self.tubes
            ]  # of its own sphere a ray meets the far side only, if it goes inwards
            far[on & (far < self.radius * 1e-9)] = np.inf
            ball = np.where((near > low) & ~on, near, far)
            ball[~(ball > low)] = np.inf
        return np.concatenate([flat, ball, self._tubes(o, d, here[:, self.tubes :], low)], axis=1)

    def _tubes(self, o: Array, d: Array, on: Array, low: Array) -> Array:
        """(N, T) distances to the walls of cylinders: |o + t d - p0|² - ((o + t d - p0)·axis)² = r²."""
        with np.errstate(all="ignore"):
            out = o[:, None] - self.ends[None, :, 0]
            z, dz = (out * self.axis).sum(axis=-1), d @ self.axis.T
            a = 1 - dz**2
            b = (out * d[:, None]).sum(axis=-1) - z * dz
            c = (out**2).sum(axis=-1) - z**2 - self.tube_radius**2
            root = np.sqrt(b**2 - a * np.where(on, 0, c))
            found = np.full_like(z, np.inf)
            for t in ((-b - root) / a, (-b + root) / a):
                good = (
                    (t > np.where(on, 1e-9 * self.tube_radius, low))
                    & (z + t * dz >= 0)
                    & (z + t * dz <= self.height)
                )
                found = np.where(good & (t < found), t, found)
        return found

    def surface(self, which: Array, p: Array) -> tuple[Array, Array]:
        """The normal, and the one that shades."""
        true, shading = np.empty_like(p), np.empty_like(p)
        flat = which < self.flats
        i, q = which[flat], p[flat]
        true[flat] = self.normal[i]
        s, t = _dot(q - self.o[i], self.dual_s[i]), _dot(q - self.o[i], self.dual_t[i])
        weights = np.stack([1 - s - t, s, t], axis=-1)
        shading[flat] = _unit((weights[..., None] * self.smooth[i]).sum(axis=1))
        ball, tube = (which >= self.flats) & (which < self.tubes), which >= self.tubes
        i, q = which[ball] - self.flats, p[ball]
        true[ball] = _unit(q - self.center[i]) * np.where(self.inward[i], -1.0, 1.0)[:, None]
        i, q = which[tube] - self.tubes, p[tube]
        true[tube] = self._outward(i, q) * np.where(self.tube_inward[i], -1.0, 1.0)[:, None]
        shading[~flat] = true[~flat]
        return true, shading

    def _outward(self, i: Array, q: Array) -> Array:
        out = q - self.ends[i, 0]
        return _unit(out - _dot(out, self.axis[i])[:, None] * self.axis[i])

    def edges(self, which: Array) -> Array:
        """(2, N, 3) how points of parallelograms move with u and with v."""
        assert (self.kind[which] == "parallelogram").all()
        by = np.linalg.inv(self.uv[which, 1:] - self.uv[which, :1])
        found: Array = np.einsum("nak,knd->and", by, np.stack([self.u[which], self.v[which]]))
        return found

    def coordinates(self, which: Array, p: Array) -> tuple[Array, Array]:
        """(u, v) (N, 2), which mean nothing on a triangle, and unit vectors (N, 3) where u grows."""
        uv, along = np.empty((len(p), 2)), np.empty_like(p)
        flat = which < self.flats
        i, q = which[flat], p[flat]
        s, t = (_dot(q - self.o[i], dual[i])[:, None] for dual in (self.dual_s, self.dual_t))
        corner, ends = self.uv[i, :1], self.uv[i, 1:]
        found = corner[:, 0] + s * (ends - corner)[:, 0] + t * (ends - corner)[:, 1]
        to_u = np.linalg.pinv(ends - corner)[:, 0]  # how fast s and t grow with u
        r = np.hypot(s, t)
        disk = (self.kind[i] == "disk")[:, None]
        uv[flat] = np.where(disk, np.hstack([r, np.arctan2(t, s) / (2 * np.pi) % 1]), found)
        with np.errstate(invalid="ignore"):  # of a disk's center, and of what has no coordinates
            s, t = np.where(disk, s / r, to_u[:, :1]), np.where(disk, t / r, to_u[:, 1:])
            along[flat] = _unit(s * self.u[i] + t * self.v[i])
        ball, tube = (which >= self.flats) & (which < self.tubes), which >= self.tubes
        i, q = which[ball] - self.flats, p[ball]
        x, y, z = np.einsum("iab,ib->ai", self.axes[i], _unit(q - self.center[i]))
        angle = np.arctan2(y, x)
        uv[ball] = np.stack([angle / (2 * np.pi) % 1, np.arccos(np.clip(z, -1, 1)) / np.pi], axis=-1)
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        along[ball] = cosine * self.axes[i, 1] - sine * self.axes[i, 0]
        i, q = which[tube] - self.tubes, p[tube]
        x, y, _ = np.einsum("iab,ib->ai", self.tube_axes[i], self._outward(i, q))
        angle = np.arctan2(y, x)
        height = _dot(q - self.ends[i, 0], self.axis[i]) / self.height[i]
        uv[tube] = np.stack([angle / (2 * np.pi) % 1, height], axis=-1)
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        along[tube] = cosine * self.tube_axes[i, 1] - sine * self.tube_axes[i, 0]
        return uv, along

    def areas(self) -> Array:
        size = np.linalg.norm(np.cross(self.u, self.v), axis=1)
        factor = np.where(self.kind == "disk", np.pi, np.where(self.kind == "triangle", 0.5, 1.0))
        walls = 2 * np.pi * self.tube_radius * self.height
        return np.concatenate([factor * size, 4 * np.pi * self.radius**2, walls])

    def points(self, which: Array, x: Array, y: Array) -> Array:
        """Uniform points of primitives, from two uniform numbers each."""
        p = np.empty((len(which), 3))
        flat = which < self.flats
        i, s, t = which[flat], x[flat].copy(), y[flat].copy()
        over = (self.kind[i] == "triangle") & (s + t > 1)
        s[over], t[over] = 1 - s[over], 1 - t[over]
        r, angle = np.sqrt(x[flat]), 2 * np.pi * y[flat]
        disk = self.kind[i] == "disk"
        s, t = np.where(disk, r * np.cos(angle), s), np.where(disk, r * np.sin(angle), t)
        p[flat] = self.o[i] + s[:, None] * self.u[i] + t[:, None] * self.v[i]
        ball, tube = (which >= self.flats) & (which < self.tubes), which >= self.tubes
        i, z, angle = which[ball] - self.flats, 1 - 2 * x[ball], 2 * np.pi * y[ball]
        r = np.sqrt(1 - z**2)
        way = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1)
        p[ball] = self.center[i] + self.radius[i, None] * way
        i, angle = which[tube] - self.tubes, 2 * np.pi * y[tube, None]
        u, v = _frame(self.axis[i])
        along = x[tube, None] * (self.ends[i, 1] - self.ends[i, 0])
        p[tube] = (
            self.ends[i, 0] + along + self.tube_radius[i, None] * (np.cos(angle) * u + np.sin(angle) * v)
        )
        return p


# ---- materials: those of the schema, their parts behind them


def flat_materials(materials: list[dict[str, Any]]) -> list[dict[str, Any]]:
    flat = [dict(one) for one in materials]
    for one in flat:  # grows as it goes
        if one["type"] == "blend":
            one["first"] = len(flat)
            flat += [dict(part) for part in one["parts"]]
    return flat


def fresnel_metal(cosine: Array, eta: Array, k: Array) -> Array:
    """(N, 3), Born & Wolf."""
    c2 = cosine[:, None] ** 2
    s2 = 1 - c2
    base = eta**2 - k**2 - s2
    both = np.sqrt(base**2 + 4 * eta**2 * k**2)
    a = np.sqrt(np.maximum((both + base) / 2, 0))
    c = cosine[:, None]
    rs = (both + c2 - 2 * a * c) / (both + c2 + 2 * a * c)
    rp = rs * (c2 * both + s2**2 - 2 * a * c * s2) / (c2 * both + s2**2 + 2 * a * c * s2)
    return (rs + rp) / 2


def fresnel_glass(cosine: Array, ratio: Array) -> tuple[Array, Array]:
    """Reflectance, and the cosine beyond (NaN: total reflection); `ratio` is the index there over here."""
    with np.errstate(invalid="ignore"):
        beyond = np.sqrt(1 - (1 - cosine**2) / ratio**2)
    across = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    along = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    return np.where(np.isnan(beyond), 1.0, (across**2 + along**2) / 2), beyond


class Ggx:
    """Microfacets with roughnesses (N, 2) along and across unit vectors (N, 3) of the surface, and its n."""

    def __init__(self, alphas: Array, frame: tuple[Array, Array, Array]):
        self.alphas, self.frame = alphas, frame

    def _local(self, w: Array) -> tuple[Array, Array]:
        """(N, 2) along and across, and (N,) along n, not less than nearly 0."""
        u, v, n = self.frame
        return np.stack([_dot(w, u), _dot(w, v)], axis=-1), np.maximum(_dot(w, n), 1e-12)

    def density(self, h: Array) -> Array:
        """D of half vectors (N, 3)."""
        xy, z = self._local(h)
        return 1 / (np.pi * np.prod(self.alphas, axis=-1) * (_dot(xy, xy / self.alphas**2) + z**2) ** 2)

    def shadowing(self, w: Array) -> Array:
        """Smith's G1."""
        xy, z = self._local(w)
        return 2 / (1 + np.sqrt(1 + _dot(xy, xy * self.alphas**2) / z**2))

    def steepness(self, x: Array) -> Array:
        """tanθ/α of half vectors by D cosθ, from a uniform number each."""
        return np.sqrt(x / (1 - x))

    def sample(self, x: Array, y: Array) -> Array:
        """Half vectors (N, 3) by D cosθ, from two uniform numbers each."""
        slope, angle = self.steepness(x), 2 * np.pi * y
        u, v, n = self.frame
        s, t = self.alphas.T.reshape(2, -1) * slope * np.stack([np.cos(angle), np.sin(angle)])
        return _unit(s[:, None] * u + t[:, None] * v + n)


class Beckmann(Ggx):
    """Gaussian slopes; G1 by Mitsuba's fit."""

    def density(self, h: Array) -> Array:
        xy, z = self._local(h)
        slope = _dot(xy, xy / self.alphas**2) / z**2
        return np.exp(-slope) / (np.pi * np.prod(self.alphas, axis=-1) * z**4)

    def shadowing(self, w: Array) -> Array:
        xy, z = self._local(w)
        a = z / np.sqrt(np.maximum(_dot(xy, xy * self.alphas**2), 1e-30))
        return np.where(a < 1.6, (3.535 * a + 2.181 * a * a) / (1 + 2.276 * a + 2.577 * a * a), 1)

    def steepness(self, x: Array) -> Array:
        return np.sqrt(-np.log1p(-x))


def facets_of(m: Any, alphas: Array, frame: tuple[Array, Array, Array]) -> Ggx:
    return (Beckmann if m["beckmann"] else Ggx)(alphas, frame)


class Tracer:
    def __init__(self, data: dict[str, Any], seed: int):
        self.data = data
        self.shapes = Primitives(data)
        self.materials = flat_materials(data["materials"])
        self.rng = np.random.default_rng(seed)
        power = self.shapes.areas() * self.shapes.radiance.sum(axis=1)
        self.lamps = np.flatnonzero(power > 0)
        self.lamp_p = power[self.lamps] / power[self.lamps].sum() if len(self.lamps) else power[:0]
        self.lamp_area = self.shapes.areas()[self.lamps]
        self.sky = np.array(data["sky"])

    def render(self, count: int) -> tuple[Array, Array]:
        """So many paths, equally many in each cell of a grid over the image: where on it (N, 2), from 0 to 1
        from its top left, and their radiance (N, 3).
        """
        side = int(np.sqrt(count))
        grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
        film = (grid + self.rng.random(grid.shape)) / side
        return film, self._trace(*self._camera(film))

    def _camera(self, film: Array) -> tuple[Array, Array, Array]:
        camera = {name: np.array(value) for name, value in self.data["camera"].items() if name != "lens"}
        lens = self.data["camera"].get("lens")
        x, y = film[:, :1], film[:, 1:]
        right, down = camera["top_right"] - camera["top_left"], camera["bottom_left"] - camera["top_left"]
        way = camera["top_left"] + x * right + y * down
        if "direction" in camera:
            d = np.broadcast_to(camera["direction"], way.shape).copy()
            return camera["origin"] + way, d, np.ones(len(d))
        d = _unit(way)
        if lens:
            view, focus = np.array(lens["view"]), lens["focus_distance"]
            r, angle = np.sqrt(self.rng.random(len(d))), 2 * np.pi * self.rng.random(len(d))
            aside = np.outer(r * np.cos(angle), lens["axis_u"]) + np.outer(r * np.sin(angle), lens["axis_v"])
            d = _unit(d * (focus / (d @ view))[:, None] - aside)
            return camera["origin"] + aside, d, d @ view
        forward = _unit(camera["top_left"] + (right + down) / 2)
        return np.broadcast_to(camera["origin"], d.shape).copy(), d, d @ forward

    def _trace(self, o: Array, d: Array, along: Array) -> Array:
        shapes, data = self.shapes, self.data
        result = np.zeros_like(o)
        path = np.arange(len(o))  # which paths are left
        weight, delta, start = np.ones_like(o), np.ones(len(o), bool), np.full(len(o), -1)
        low, high = data["camera"]["near_clip"] / along, data["camera"]["far_clip"] / along
        hidden = shapes.radiance.any(axis=1) if data["hide_emitters"] else None
        most = data["max_depth"] if data["max_depth"] >= 0 else NO_LIMIT
        for depth in range(1, most + 1):
            which, t = shapes.meet(o, d, start, low, high, hidden)
            away = which < 0
            if depth > 1 or not data["hide_emitters"]:
                result[path[away]] += weight[away] * self._sky(d[away])
            path, weight, delta, which, t = (x[~away] for x in (path, weight, delta, which, t))
            o, d = o[~away], d[~away]
            p = o + t[:, None] * d
            true, normal = shapes.surface(which, p)
            seen = delta & (_dot(true, d) < 0)
            result[path[seen]] += weight[seen] * shapes.radiance[which[seen]]
            if depth == most or not len(path):
                break
            o, start, low, high, hidden = p, which, 0.0, np.inf, None
            light, d, factor, delta = self._scatter(which, p, -d, normal)
            result[path] += weight * light
            weight = weight * factor
            stays = np.ones(len(path))
            if data["max_depth"] < 0 and depth > 3:
                stays = np.minimum(weight.max(axis=1), 0.95)
            left = self.rng.random(len(path)) < stays
            left &= weight.any(axis=1)
            path, weight, o, d, delta, start = (x[left] for x in (path, weight, o, d, delta, start))
            weight = weight / stays[left, None]
        return result

    def _scatter(self, which: Array, p: Array, wo: Array, normal: Array) -> tuple[Array, Array, Array, Array]:
        """Of paths at p: light that comes straight from lamps and is reflected to wo; where they go on, with
        which weight, and whether they find lamps by chance.
        """
        count = len(which)
        light, wi, factor = np.zeros((count, 3)), wo.copy(), np.zeros((count, 3))
        delta = np.ones(count, bool)
        index, n = self.shapes.material[which], normal.copy()
        while True:  # a blend is one of its parts, by chance; what is two-sided has its normal towards wo
            two = np.array([m["two_sided"] for m in self.materials], dtype=bool)[index]
            n = np.where((two & (_dot(n, wo) < 0))[:, None], -n, n)
            blend = np.array([m["type"] == "blend" for m in self.materials], dtype=bool)[index]
            if not blend.any():
                break
            share = np.zeros(count)
            for number in np.unique(index[blend]):
                on = index == number
                share[on] = self._number(self.materials[number], "weight_of_second", which[on], p[on])
            first = np.array([m.get("first", 0) for m in self.materials])[index]
            index = np.where(blend, first + (self.rng.random(count) < share), index)
        for number, material in enumerate(self.materials):
            on = np.flatnonzero(index == number)
            if not material["type"].endswith(("dielectric", "null")) and material.get("spec_trans", 0) == 0:
                on = on[_dot(n[on], wo[on]) > 0]
            if material["type"] == "blend" or not len(on):
                continue
            method = getattr(self, "_" + material["type"].replace(" ", "_"))
            if "bump" not in material:
                light[on], wi[on], factor[on], delta[on] = method(material, which[on], p[on], wo[on], n[on])
                continue
            turned, alpha2 = self._bumped(material["bump"], which[on], p[on], wo[on], normal[on])
            _, wi[on], factor[on], _ = method(material, which[on], p[on], wo[on], turned)
            own, other = (
                _dot(wi[on], np.sign(_dot(normal[on], wo[on]))[:, None] * normal[on]),
                _dot(wi[on], turned),
            )
            shadow = 2 / (1 + np.sqrt(1 + alpha2 * (1 - own**2) / own**2))
            factor[on] *= np.where((own * other > 0) & (_dot(turned, wo[on]) > 0), shadow, 0.0)[:, None]
        return light, wi, factor, delta

    def _bumped(self, bump: Any, which: Array, p: Array, wo: Array, n: Array) -> tuple[Array, Array]:
        """The normal on the viewer's side, and the roughness whose square shadows are cast by."""
        assert not self.data["lights"]  # all light is found by chance then
        behind = (_dot(wo, n) < 0)[:, None]
        seen, (uv, along) = np.where(behind, -n, n), self.shapes.coordinates(which, p)
        if bump["of"] == "normals":
            x, y, z = 2 * self._picture(bump, uv).T[:, :, None] - 1
            u = _unit(along - _dot(along, n)[:, None] * n)
            across = x * u + y * np.cross(n, u)
        else:
            edges = []
            for axis, edge in enumerate(self.shapes.edges(which)):
                step = 1e-7 * np.eye(2)[axis]
                slope = (self._picture(bump, uv + step) - self._picture(bump, uv - step)) / 2e-7
                height = bump["scale"] * slope @ [0.212671, 0.715160, 0.072169]
                edges.append(edge + (height - _dot(n, edge))[:, None] * n)
            turned = _unit(np.cross(*edges))
            turned *= np.sign(_dot(turned, n))[:, None]
            z = _dot(turned, n)[:, None]
            across = turned - z * n
        across = np.where(behind & (not bump["turned"]), -across, across)
        across *= np.where(_dot(wo, z * seen + across) > 0, 1, -1)[:, None]
        turned = _unit(z * seen + across)
        cosine = _dot(turned, seen)
        return turned, np.minimum(0.125 * (1 - cosine**2) / cosine**2, 1) * bump["shadowed"]

    def _picture(self, m: Any, uv: Array) -> Array:
        place = np.hstack([uv, np.ones((len(uv), 1))]) @ np.array(m["to_uv"]).T
        return self._pixels(np.array(m["pixels"]), m["filter"], m["wrap"], place)

    def _number(self, m: Any, name: str, which: Array, p: Array) -> Array:
        """(N,)"""
        if name in m:
            return np.full(len(p), m[name])
        return np.broadcast_to(self._colour(m, name, which, p), p.shape)[:, 0]

    def _alphas(self, m: Any, which: Array, p: Array) -> Array:
        """(N, 2) along and across."""
        names = ("alpha",) * 2 if "alpha" in m or "alpha_texture" in m else ("alpha_u", "alpha_v")
        return np.maximum(np.stack([self._number(m, name, which, p) for name in names], axis=-1), 1e-4)

    def _colour(self, m: Any, name: str, which: Array, p: Array) -> Array:
        """(3,), or of a texture (N, 3) at p."""
        prefix = "" if name == "reflectance" else f"{name}_"
        if prefix + "texture" not in m:
            return np.array(m[name])
        uv, _ = self.shapes.coordinates(which, p)
        place = np.hstack([uv, np.ones((len(p), 1))]) @ np.array(m[prefix + "to_uv"]).T
        if m[prefix + "texture"] == "bitmap":
            kind, wrap = (m[prefix + name] for name in ("filter", "wrap"))
            return self._pixels(np.array(m[prefix + "pixels"]), kind, wrap, place)
        assert m[prefix + "texture"] == "checkerboard"
        second = place[:, :2] % 1 > 0.5
        differ = (second[:, 0] != second[:, 1])[:, None]
        return np.where(differ, m[prefix + "color1"], m[prefix + "color0"])

    def _pixels(self, pixels: Array, kind: str, wrap: str, place: Array) -> Array:
        size = np.array([pixels.shape[1], pixels.shape[0]])
        at = place[:, :2] * size - (0.5 if kind == "bilinear" else 0.0)
        low = np.floor(at).astype(int)
        share = at - low if kind == "bilinear" else np.zeros_like(at)
        total = np.zeros((len(place), 3))
        for dx, dy in itertools.product((0, 1), (0, 1)):
            index = low + np.array((dx, dy))
            if wrap == "repeat":
                index = index % size
            elif wrap == "mirror":
                index = np.where(index % (2 * size) < size, index % size, size - 1 - index % size)
            index = np.clip(index, 0, size - 1)
            weight = np.where((dx, dy), share, 1 - share).prod(axis=1)
            total += weight[:, None] * pixels[index[:, 1], index[:, 0]]
        return total

    def _sky(self, d: Array) -> Array:
        if "sky_map" not in self.data:
            return np.broadcast_to(self.sky, d.shape)
        pixels, axes = (np.array(self.data["sky_map"][name]) for name in ("pixels", "axes"))
        x, y, z = axes @ d.T
        height, width, _ = pixels.shape
        column = np.arctan2(x, -z) / (2 * np.pi) * width - 0.5
        row = np.arccos(np.clip(y, -1, 1)) / np.pi * (height - 1)
        i, j = np.floor(column).astype(int), np.minimum(row.astype(int), height - 2)
        fx, fy = (column - i)[:, None], (row - j)[:, None]
        upper = (1 - fx) * pixels[j, i % width] + fx * pixels[j, (i + 1) % width]
        lower = (1 - fx) * pixels[j + 1, i % width] + fx * pixels[j + 1, (i + 1) % width]
        result: Array = (1 - fy) * upper + fy * lower
        return result

    def _diffuse(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        f = np.broadcast_to(self._colour(m, "reflectance", which, p) / np.pi, p.shape)
        light = self._points(which, p, n, lambda wi: f)
        if len(self.lamps):
            light = light + f * self._lamp(which, p, n)
        return light, self._hemisphere(n), f * np.pi, np.zeros(len(p), bool)

    def _hemisphere(self, n: Array) -> Array:
        """Directions about n, with the density cosθ/π."""
        x, y = self.rng.random((2, len(n)))
        u, v = _frame(n)
        r, angle = np.sqrt(x)[:, None], (2 * np.pi * y)[:, None]
        return _unit(r * np.cos(angle) * u + r * np.sin(angle) * v + np.sqrt(1 - x)[:, None] * n)

    def _mirror(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        wi = 2 * _dot(wo, n)[:, None] * n - wo
        return 0.0, wi, np.broadcast_to(self._colour(m, "reflectance", which, p), p.shape), True

    def _null(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        return 0.0, -wo, np.ones_like(p), True

    def _conductor(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        light, wi, factor, delta = self._mirror(m, which, p, wo, n)
        return light, wi, factor * fresnel_metal(_dot(wo, n), np.array(m["eta"]), np.array(m["k"])), delta

    def _dielectric(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        outside = _dot(wo, n) > 0
        n = np.where(outside[:, None], n, -n)
        ratio = np.where(outside, m["eta"], 1 / m["eta"])
        cosine = _dot(wo, n)
        share, beyond = fresnel_glass(cosine, ratio)
        reflects = self.rng.random(len(p)) < share
        through = (cosine / ratio - np.nan_to_num(beyond))[:, None] * n - wo / ratio[:, None]
        wi = np.where(reflects[:, None], 2 * cosine[:, None] * n - wo, through)
        refracted = self._colour(m, "transmittance", which, p) / ratio[:, None] ** 2
        reflected = self._colour(m, "reflectance", which, p)
        return 0.0, _unit(wi), np.where(reflects[:, None], reflected, refracted), True

    def _thin_dielectric(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        cosine = _dot(wo, n)[:, None]
        face = fresnel_glass(np.abs(cosine), np.array(m["eta"]))[0]
        reflects = self.rng.random((len(p), 1)) < 2 * face / (1 + face)
        colours = (self._colour(m, name, which, p) for name in ("reflectance", "transmittance"))
        return 0.0, np.where(reflects, 2 * cosine * n - wo, -wo), np.where(reflects, *colours), True

    def _plastic(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        base, coat = self._base(m, which, p), self._colour(m, "specular", which, p)

        def through(w: Array) -> Array:
            return 1 - fresnel_glass(np.abs(_dot(w, n)), np.array(m["eta"]))[0][:, None]

        light = self._points(which, p, n, lambda wi: base / np.pi * through(wo) * through(wi))
        mirrors = self.rng.random((len(p), 1)) < 0.5
        wi = np.where(mirrors, 2 * _dot(wo, n)[:, None] * n - wo, self._hemisphere(n))
        factor = np.where(mirrors, coat * (1 - through(wo)), base * through(wo) * through(wi))
        return light, wi, 2 * factor, True

    def _principled(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        """One direction in two by the cosine, one by a facet that reflects or refracts."""
        names = ("roughness", "anisotropic", "metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint",
                 "flatness", "clearcoat")  # fmt: skip
        k = {name: self._number(m, name, which, p) for name in names}
        front = _dot(wo, n) > 0
        n, ratio = np.where(front[:, None], n, -n), np.where(front, m["eta"], 1 / m["eta"])
        base = np.broadcast_to(self._colour(m, "reflectance", which, p), p.shape)
        bright = base @ [0.212671, 0.715160, 0.072169]
        tint = np.where(bright[:, None] > 0, base / np.maximum(bright, 1e-300)[:, None], 1)
        aspect = np.sqrt(1 - 0.9 * k["anisotropic"])
        alphas = np.maximum(
            np.stack([k["roughness"] ** 2 / aspect, k["roughness"] ** 2 * aspect], axis=-1), 1e-3
        )
        u = _frame(n)[0]
        if k["anisotropic"].any():
            _, along = self.shapes.coordinates(which, p)
            u = _unit(along - _dot(along, n)[:, None] * n)
        ggx = Ggx(alphas, (u, np.cross(n, u), n))
        glass, diffuse = (
            (1 - k["metallic"]) * k["spec_trans"],
            front * (1 - k["metallic"]) * (1 - k["spec_trans"]),
        )

        def value(wi: Array) -> tuple[Array, Array]:
            """f cosθ (N, 3), and the density."""
            reflects, ci, co = _dot(wi, n) > 0, np.abs(_dot(wi, n)), _dot(wo, n)
            scale = np.where(reflects, 1, ratio)
            h = _unit(wo + scale[:, None] * wi)
            h *= np.sign(_dot(h, n))[:, None]
            o, i = _dot(wo, h), _dot(wi, h)
            c, side = np.clip(o, 0, 1), (o > 0) & (np.where(reflects, i, -i) > 0)
            share, beyond = fresnel_glass(c, ratio)
            weight = (1 - np.where(m["eta"] > 1, c, np.nan_to_num(beyond))) ** 5
            d, g = ggx.density(h), ggx.shadowing(wo) * ggx.shadowing(np.where(reflects[:, None], wi, -wi))
            rest = weight[:, None]
            metal = k["metallic"][:, None] * (base + (1 - base) * rest)
            r0 = tint * ((ratio - 1) / (ratio + 1))[:, None] ** 2
            plain = (1 - k["metallic"])[:, None]
            spec = k["spec_tint"][:, None]
            fresnel = metal + plain * (spec * (r0 + (1 - r0) * rest) + (1 - spec) * share[:, None])
            fresnel = np.where(front[:, None], fresnel, (glass * share)[:, None])
            out = fresnel * (d * g / (4 * co))[:, None]
            a2 = (0.1 - 0.099 * m["clearcoat_gloss"]) ** 2
            coat = (a2 - 1) / (np.pi * np.log(a2) * (1 + (a2 - 1) * _dot(h, n) ** 2)) * (0.04 + 0.96 * weight)
            g1 = [2 / (1 + np.sqrt(1 + 0.0625 * (1 / w**2 - 1))) for w in (co, ci)]
            out += (front * 0.25 * k["clearcoat"] * coat * g1[0] * g1[1] * ci)[:, None]
            fo, fi, back = (1 - co) ** 5, (1 - ci) ** 5, 2 * k["roughness"] * c * c
            smooth = (1 - fo / 2) * (1 - fi / 2) + back * (fo + fi + fo * fi * (back - 1))
            under = (1 + (back / 2 - 1) * fo) * (1 + (back / 2 - 1) * fi)
            flat = 1.25 * (under * (1 / (co + ci) - 0.5) + 0.5)
            smooth += (flat - smooth) * k["flatness"]
            out += base * (diffuse * smooth * ci / np.pi)[:, None]
            sheen = front * k["sheen"] * (1 - k["metallic"]) * (1 - c) ** 5 * ci
            out += (1 + (tint - 1) * k["sheen_tint"][:, None]) * sheen[:, None]
            bent = np.abs(o * i) / (o + scale * i) ** 2
            through = np.sqrt(base) * (glass * (1 - share) * d * g * bent / co)[:, None]
            facet = (
                d
                * _dot(h, n)
                * np.where(reflects, 1 / (4 * c + 1e-300), np.abs(i) * scale**2 / (o + scale * i) ** 2)
            )
            split = np.where(glass > 0, 0.5, np.where(reflects, 1, 0))
            pdf = 0.5 * np.where(reflects, ci / np.pi, 0) + 0.5 * split * facet * side
            return np.where(side[:, None], np.where(reflects[:, None], out, through), 0), pdf

        h = ggx.sample(*self.rng.random((2, len(p))))
        cosine = _dot(wo, h)
        _, beyond = fresnel_glass(np.abs(cosine), ratio)
        refracts = (glass > 0) & (self.rng.random(len(p)) < 0.5)
        through = (cosine / ratio - np.nan_to_num(beyond))[:, None] * h - wo / ratio[:, None]
        facet = np.where(refracts[:, None], through, 2 * cosine[:, None] * h - wo)
        wi = _unit(np.where((self.rng.random(len(p)) < 0.5)[:, None], self._hemisphere(n), facet))
        with np.errstate(all="ignore"):
            f, pdf = value(wi)
            factor = np.where((pdf > 0)[:, None], f / pdf[:, None], 0.0)
        return (
            self._points(which, p, n, lambda w: value(w)[0] / np.maximum(_dot(w, n), 1e-12)[:, None]),
            wi,
            factor,
            True,
        )

    def _base(self, m: Any, which: Array, p: Array) -> Array:
        """Reflectance under a coat: of light that comes in once, all that goes out in the end."""
        colour = self._colour(m, "reflectance", which, p)
        return colour / (1 - m["internal"] * (colour if m["nonlinear"] else 1)) / m["eta"] ** 2

    def _rough_plastic(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        base, tint = self._base(m, which, p), self._colour(m, "specular", which, p)
        facets = facets_of(m, self._alphas(m, which, p), (*_frame(n), n))

        def through(w: Array) -> Array:
            at = np.linspace(0, 1, len(m["coat_transmittance"]))
            return np.interp(_dot(w, n), at, m["coat_transmittance"])[:, None]

        def fresnel(h: Array) -> Array:
            return fresnel_glass(np.clip(_dot(wo, h), 0, 1), np.array(m["eta"]))[0]

        def f(wi: Array) -> Array:
            h = _unit(wi + wo)
            ci, co = (np.maximum(_dot(w, n), 1e-12) for w in (wi, wo))
            g = facets.shadowing(wi) * facets.shadowing(wo)
            coat = fresnel(h) * facets.density(h) * g / (4 * ci * co)
            return tint * coat[:, None] + base / np.pi * through(wo) * through(wi)

        light = self._points(which, p, n, f)
        h, mirrors = facets.sample(*self.rng.random((2, len(p)))), self.rng.random((len(p), 1)) < 0.5
        wi = np.where(mirrors, 2 * _dot(wo, h)[:, None] * h - wo, self._hemisphere(n))
        above = (_dot(wi, n) > 0) & ((_dot(wo, h) > 0) | ~mirrors[:, 0])
        g = facets.shadowing(wi) * facets.shadowing(wo)
        share = (fresnel(h) * g * _dot(wo, h) / (_dot(wo, n) * _dot(h, n)))[:, None]
        factor = np.where(mirrors, tint * share, base * through(wo) * through(wi))
        return light, _unit(wi), np.where(above[:, None], 2 * factor, 0.0), True

    def _rough_conductor(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        return self._microfacets(m, facets_of(m, self._alphas(m, which, p), (*_frame(n), n)), which, p, wo)

    def _anisotropic_conductor(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        _, along = self.shapes.coordinates(which, p)
        u = _unit(along - _dot(along, n)[:, None] * n)
        facets = facets_of(m, self._alphas(m, which, p), (u, np.cross(n, u), n))
        return self._microfacets(m, facets, which, p, wo)

    def _rough_dielectric(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        return self._rough_glass(m, _frame(n), which, p, wo, n)

    def _anisotropic_dielectric(self, m: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        _, along = self.shapes.coordinates(which, p)
        u = _unit(along - _dot(along, n)[:, None] * n)
        return self._rough_glass(m, (u, np.cross(n, u)), which, p, wo, n)

    def _rough_glass(self, m: Any, across: Any, which: Array, p: Array, wo: Array, n: Array) -> Any:
        """A facet by D cosθ; lights in a point, which this finds by no chance, are none of its scenes."""
        assert not self.data["lights"]
        outside = _dot(wo, n) > 0
        n, ratio = np.where(outside[:, None], n, -n), np.where(outside, m["eta"], 1 / m["eta"])
        facets = facets_of(m, self._alphas(m, which, p), (*across, n))
        h = facets.sample(*self.rng.random((2, len(p))))
        cosine = np.maximum(_dot(wo, h), 1e-12)
        share, beyond = fresnel_glass(cosine, ratio)
        reflects = self.rng.random(len(p)) < share
        through = (cosine / ratio - np.nan_to_num(beyond))[:, None] * h - wo / ratio[:, None]
        wi = np.where(reflects[:, None], 2 * cosine[:, None] * h - wo, through)
        side = np.where(reflects, 1, -1)
        kept = (_dot(wo, h) > 0) & (side * _dot(wi, n) > 0)
        g = facets.shadowing(wo) * facets.shadowing(side[:, None] * wi)
        weight = np.where(kept, g * cosine / (_dot(wo, n) * _dot(h, n)), 0.0)[:, None]
        tints = [self._colour(m, name, which, p) for name in ("reflectance", "transmittance")]
        factor = np.where(reflects[:, None], tints[0], tints[1] / ratio[:, None] ** 2)
        return 0.0, _unit(wi), factor * weight, True

    def _microfacets(self, m: Any, facets: Ggx, which: Array, p: Array, wo: Array) -> Any:
        tint, n = self._colour(m, "reflectance", which, p), facets.frame[2]
        index = np.array(m["eta"]), np.array(m["k"])

        def f(wi: Array) -> Array:
            h = _unit(wi + wo)
            ci, co = (np.maximum(_dot(w, n), 1e-12) for w in (wi, wo))
            g = facets.shadowing(wi) * facets.shadowing(wo)
            d = facets.density(h) * g / (4 * ci * co)
            return tint * fresnel_metal(_dot(wo, h), *index) * d[:, None]

        light = self._points(which, p, n, f)
        h = facets.sample(*self.rng.random((2, len(p))))
        wi = 2 * _dot(wo, h)[:, None] * h - wo
        above = (_dot(wi, n) > 0) & (_dot(wo, h) > 0)
        g = facets.shadowing(wi) * facets.shadowing(wo)
        share = np.where(above, g * _dot(wo, h) / (_dot(wo, n) * _dot(h, n)), 0.0)[:, None]
        factor = tint * fresnel_metal(np.clip(_dot(wo, h), 0, 1), *index) * share
        return light, _unit(wi), factor, True

    # ---- light that comes straight

    def _lamp(self, which: Array, p: Array, n: Array) -> Array:
        """(N, 3) the irradiance that one lamp gives, chosen by its power."""
        chosen = self.rng.choice(len(self.lamps), len(p), p=self.lamp_p)
        lamp = self.lamps[chosen]
        q = self.shapes.points(lamp, *self.rng.random((2, len(p))))
        true, _ = self.shapes.surface(lamp, q)
        distance = np.linalg.norm(q - p, axis=1)
        with np.errstate(all="ignore"):
            wi = (q - p) / distance[:, None]
            cosines = np.maximum(_dot(wi, n), 0) * np.maximum(-_dot(wi, true), 0)
            size = cosines / distance**2 * self.lamp_area[chosen] / self.lamp_p[chosen]
        on = np.flatnonzero(np.isfinite(size) & (size > 0))
        met, _ = self.shapes.meet(p[on], wi[on], which[on])
        on = on[met == lamp[on]]
        result = np.zeros_like(p)
        result[on] = size[on, None] * self.shapes.radiance[lamp[on]]
        return result

    def _points(self, which: Array, p: Array, n: Array, f: Any) -> Array:
        """(N, 3) what is reflected of lights in a point, spots and suns."""
        result = np.zeros_like(p)
        for light in self.data["lights"]:
            distance = np.full(len(p), np.inf)
            if light["type"] == "sun":
                wi = np.broadcast_to(-np.array(light["direction"]), p.shape)
                arrives = np.broadcast_to(light["irradiance"], p.shape)
            else:
                between = np.array(light["position"]) - p
                distance = np.linalg.norm(between, axis=1)
                wi = between / distance[:, None]
                arrives = np.array(light["intensity"]) / distance[:, None] ** 2
            if light["type"] == "spot light":
                angle = np.arccos(np.clip(-wi @ np.array(light["axis"]), -1, 1))
                cutoff, beam = light["cutoff_radians"], light["beam_radians"]
                fall = np.clip((cutoff - angle) / max(cutoff - beam, 1e-300), 0, 1)
                arrives = arrives * np.where(angle < beam, 1.0, fall)[:, None]
            cosine = _dot(wi, n)
            _, t = self.shapes.meet(p, wi, which)
            free = (cosine > 0) & (t >= distance * (1 - 1e-9))
            result += np.where(free[:, None], f(wi) * arrives * cosine[:, None], 0.0)
        return result
