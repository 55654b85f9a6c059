"""The functions that set a scene up give the same numbers on every host: those next to the true values."""

from __future__ import annotations

import ctypes
import math
import random
import re
import subprocess
from collections.abc import Callable

import mpmath
import pytest
from building import ROOT

SOURCES = ROOT / "src/oneray"
COUNT = 2000


@pytest.fixture(scope="module")
def functions(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("rounded")
    (folder / "hypot.c").write_text(
        '#include "rounded.h"\ndouble hypotenuse(double x, double y) { return cr_hypot(x, y); }\n',
        encoding="utf-8",
    )
    made = folder / "rounded.so"
    subprocess.run(
        ["cc", "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{SOURCES}",
         str(SOURCES / "rounded.c"), str(folder / "hypot.c"), "-o", str(made), "-lm"],
        check=True,
    )  # fmt: skip
    return ctypes.CDLL(str(made))


def near(x: float, true: Callable[[mpmath.mpf], mpmath.mpf]) -> float:
    with mpmath.workprec(300):
        return float(true(mpmath.mpf(x)))


def wide(draw: random.Random) -> float:
    return draw.choice((-1, 1)) * 10 ** draw.uniform(-12, 3)


ONE = {
    "cr_sin": (mpmath.sin, wide, (math.pi, 2 * math.pi, 1e-300, 0.0, 1e9, math.pi / 4)),
    "cr_cos": (mpmath.cos, wide, (math.pi / 2, 3 * math.pi / 2, 0.0, 1e9)),
    "cr_tan": (mpmath.tan, wide, (math.pi / 4, 1e-200, math.pi / 2, 0.0)),
    "cr_exp": (mpmath.exp, lambda draw: draw.uniform(-690, 690), (0.0, 1e-18, -1e-9, 1.0)),
    "cr_expm1": (mpmath.expm1, lambda draw: 10 ** draw.uniform(-9, 2.8), (1e-9, math.log(2))),
    "cr_log": (mpmath.log, lambda draw: 10 ** draw.uniform(-290, 290), (1.0, 0.5, 1 + 2**-52, 1 - 2**-53)),
    "cr_cbrt": (mpmath.cbrt, lambda draw: 10 ** draw.uniform(-200, 200), (0.0, 1.0, 8.0, 27.0)),
}


@pytest.mark.parametrize("name", ONE)
def test_functions_of_one_number(functions: ctypes.CDLL, name: str) -> None:
    true, any_of, special = ONE[name]
    function = functions[name]
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    draw = random.Random(name)
    for x in [*special, *(any_of(draw) for _ in range(COUNT))]:
        assert function(x) == near(x, true), (name, x.hex())


TWO = {
    "cr_atan2": (
        mpmath.atan2,
        lambda draw: (wide(draw), wide(draw)),
        ((0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (1e-300, 1e300), (1e300, -1e300), (3.0, 3.0)),
        0.5,
    ),
    "cr_pow": (
        mpmath.power,
        lambda draw: (10 ** draw.uniform(-9, 3), draw.uniform(-20, 20)),
        ((0.0, 2.4), (1.0, 5.0), (0.25, 2.0), (1e-9, 5.0)),
        0.5,
    ),
    "hypotenuse": (
        lambda x, y: mpmath.sqrt(x * x + y * y),
        lambda draw: (wide(draw) * 10 ** (e := draw.choice((-290, 0, 0, 290))), wide(draw) * 10**e),
        ((0.0, 0.0), (3.0, 4.0), (1e300, -1e300), (5e-324, 5e-324), (1.0, 1e-17), (0.0, -2.0)),
        0.53,
    ),
}


@pytest.mark.parametrize("name", TWO)
def test_functions_of_two_numbers(functions: ctypes.CDLL, name: str) -> None:
    true, any_of, special, units = TWO[name]
    function = functions[name]
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double, ctypes.c_double]
    draw = random.Random(name)
    for x, y in [*special, *(any_of(draw) for _ in range(COUNT))]:
        got = function(x, y)
        with mpmath.workprec(400):
            exact = true(mpmath.mpf(x), mpmath.mpf(y))
            if abs(exact) > 1.7e308:
                continue
            off = abs(mpmath.mpf(got) - exact) / math.ulp(float(exact))
        assert off <= units, (name, x.hex(), y.hex(), float(off))


def test_pictures_owe_nothing_to_libm() -> None:
    """Elsewhere its functions make no number of a picture: warnings, plans of time and the bytes of a PNG."""
    allowed = {"rounded.c", "scene/hints.c", "render.c", "film/picture.c"}
    names = "a?(?:sin|cos|tan)h?|atan2|exp2?|expm1|log(?:2|10|1p)?|pow|hypot|cbrt"
    called = re.compile(rf"(?<![\w.])({names})f?\(")
    wrong = []
    for path in sorted(SOURCES.rglob("*.[ch]")):
        if (name := path.relative_to(SOURCES).as_posix()) in allowed:
            continue
        text = re.sub(r"/\*.*?\*/|\"[^\"\n]*\"", " ", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        wrong += [f"{name}: {found}" for found in called.findall(text)]
    assert wrong == ["meshes/mesh.c: atan2"], "a corner's angle alone is libm's, rounded to a float"
