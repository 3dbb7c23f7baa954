"""Polynomials of dense output, in Bernstein's form, and the further stages of dop853.

Irrational ones are 40 decimals of the solution of the order conditions next to the published digits: there is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb

from integrators.method import Extension, exact
from integrators.tables.butcher import row

Polynomial = tuple[Fraction, ...]


def bernstein(*powers: Fraction) -> Polynomial:
    """The polynomial with these coefficients of theta, theta**2, ... in Bernstein's of degree n: those of 1 to n."""
    n = len(powers)
    terms = [power / comb(n, k) for k, power in enumerate(powers, 1)]
    return tuple(sum((comb(j, k) * x for k, x in enumerate(terms[:j], 1)), Fraction(0)) for j in range(1, n + 1))


def smooth(
    order: int, b: Sequence[Fraction], end: int, inner: Sequence[Polynomial], source: str,
    further: Sequence[tuple[Fraction, ...]] = (),
) -> Extension:
    """Polynomials that begin with the slope of the first stage, and end in ``b`` with that of stage ``end``.

    ``inner`` are their other coefficients in Bernstein's form, three less than the degree; () for zeros. A stage at the
    end that is none of the method's own is the first of those that follow, before ``further``.
    """
    degree = max(map(len, inner)) + 3
    last = [*b, *[Fraction(0)] * (len(inner) - len(b))]
    polynomials = tuple(
        (Fraction(i == 0, degree), *(middle or exact(*[0] * (degree - 3))), x - Fraction(i == end, degree), x)
        for i, (x, middle) in enumerate(zip(last, inner, strict=True))
    )
    rows = [tuple(b), *further] if end == len(b) else further
    filled = ((*line, *[Fraction(0)] * (len(b) + i - len(line))) for i, line in enumerate(rows))
    return Extension(order, polynomials, source, tuple(filled))


def interpolating(order: int, c: Sequence[Fraction], source: str) -> Extension:
    """The integral of the polynomial through the slopes at the nodes c: ``b_i`` is that of Lagrange's for ``c_i``."""
    found = []
    for i, node in enumerate(c):
        lagrange = [Fraction(1)]
        for other in (*c[:i], *c[i + 1 :]):
            scale = node - other
            zero = Fraction(0)
            lagrange = [(x - other * y) / scale for x, y in zip([zero, *lagrange], [*lagrange, zero], strict=True)]
        found.append(bernstein(*(x / k for k, x in enumerate(lagrange, 1))))
    return Extension(order, tuple(found), source)


RK4 = Extension(
    3,
    tuple(bernstein(*powers) for powers in (
        exact(1, "-3/2", "2/3"), exact(0, 1, "-2/3"), exact(0, 1, "-2/3"), exact(0, "-1/2", "2/3"),
    )),
    "Zennaro 1986, Math. Comp. 46, 119; Hairer, Norsett & Wanner 1993, II.6",
)

DOPRI5_INNER = (
    exact("412980443/16923123648"),
    (),
    exact("65779057100/98101232397"),
    exact("-584850925/940173536"),
    exact("42434608131/99658394816"),
    exact("-94222711/411325922"),
    exact("6769587/29380423"),
)

TSIT5_INNER = (
    exact("0.0393823004541956885545019394953862899336"),
    exact("0.02195"),
    exact("0.6550493728157919195682156115766642499579"),
    exact("-2.0685128611556128397884122327853091617972"),
    exact("6.2515522360851731964964065185107902315803"),
    exact("-4.6494210481995479648307118367975316102639"),
    exact("0.25"),
)

DOP853_FURTHER = (
    row(
        "1/10", 0, 0, 0, 0, 0, "0.2535002102166248110887947653324730673462",
        "-0.2462390374708024899174414754409517436777", "-0.1241914232638163604690101406262093878467",
        "0.1532917982787656973120632268501942687934", "0.0082010522956346898849166660205666555604",
        "0.0075678976605456997613860358958398174158", "-0.008298",
    ),
    row(
        "1/5", 0, 0, 0, 0, "0.028300909672366775528832296140239900405", "0.0535419883074385676223797384371610825811",
        "-0.0549237485713909884646569340305764809644", 0, 0, "-0.0001083473286972493228585093169943191922",
        "0.0003825710908356584129549201923225048496", "-0.000340465008687404560802977114492254171",
        "0.1413124436746325002780746183662769902455",
    ),
    row(
        "7/9", 0, 0, 0, 0, "-4.6976214153611638431444944720632951579702", "7.6834211960625990418424095387769793290535",
        "4.0689898183971100797021355433140720100326", "0.3567271874552811092706695430205556176969", 0, 0, 0,
        "-0.0013990241651590146212941800973428176736", "2.9475147891527723389556272148963855962895",
        "-9.150958472179870010818701871377811006989",
    ),
)

DOP853_INNER = (
    exact(
        "-0.2031455749409193608771994469426095551703", "0.3380447314219978210882701078442110732937",
        "-0.1413204460944449086190714044926524203602", "0.1893265514556361646934650605514308550721",
    ),
    (),
    (),
    (),
    (),
    exact(
        "0.6627454110369811625689874453767381859273", "-2.4342744145072609685470427755583684729364",
        "1.2270558460582655765024450094106725151297", "15.3788494665867105009460753396230734037905",
    ),
    exact(
        "0.124076369142552831326129404701374369297", "-0.2455658178473844839296290843626428088707",
        "-1.6542877139886619194416604645358536783999", "9.3418487599514951042164241059408540472075",
    ),
    exact(
        "-0.7151878201676040245537532999311809821836", "2.428564456346630101076335478653795277337",
        "0.4537509577131631854896347579904723846382", "-22.694464683160412334896195817026085880903",
    ),
    exact(
        "0.1452632230151660933305839610383388733925", "-0.665466539294234077284295883333713294493",
        "1.4514516502234625803533326220266709981963", "-0.685508269782834269533092117141846181879",
    ),
    exact(
        "-0.0632321158459772013207826426416412654841", "0.2863542361777695959569445838050182354836",
        "-0.6020554499634308047550656656746772876529", "0.196340190036619115851489156344852452073",
    ),
    exact(
        "0.1354539825082323486180241322059224573413", "-0.6381607807584492190269992355949419051817",
        "1.5114921731018129353954075373822531015098", "-1.1813842898264792207362408947081209962882",
    ),
    exact(
        "0.0364624107596565042718461030370942739818", "-0.1736697830244409548808848798320830627869",
        "0.4237747438835655755490247893226712040448", "-0.3759886030743263059753631263361687727842",
    ),
    exact(
        "-0.0518566826881587290866999103246697193569", "0.2472017531446667299164513225905182072411",
        "-0.6052616316621989806064367912205010623081", "0.5527737040628338369195425218117954316225",
    ),
    exact(
        "0.8642145486121298693645907126030222145611", "-1.0540166253790033333023147531950433553393",
        "0.8084162528959425315866023951141641285047", "-0.6186141761290690676488783545221429891471",
    ),
    exact(
        "-0.4378396377370645428592951640261943104077", "1.3538166848685033266129406338098466273164",
        "-0.0327600589732086034385700073067107185223", "-0.8832169881582301803150754624769415967291",
    ),
    exact(
        "-0.2112398279807092364967170093819088276128", "0.9857435274226340337487959137448320503648",
        "-2.2688277517656957394442142065879377362088", "1.4943240523237709421921353022250145136793",
    ),
)
