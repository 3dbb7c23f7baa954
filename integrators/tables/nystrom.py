"""Nyström methods of orders 4 to 8; irrational numbers are 60 decimals of the published roots.

The names RKNp(q)s are their authors': a result of order p beside one of order q from s forces, F where the last one
serves the next step, M for a small leading error, D for a dense output.

In velocity-free methods the stage velocities ``av``, at which rates of quadratures are asked for, are no part of the
published tables. In all but dprkn8 and dprkn12 they follow from interpolation and have errors O(h**p): quadratures of
any smooth rates have the order p of the method.
"""

from __future__ import annotations

from fractions import Fraction

from integrators.families.nystrom import EmbeddedNystrom, Nystrom, interpolated
from integrators.method import exact
from integrators.tables.butcher import root, triangle

NYSTROM4 = exact(0, "1/2", 1)
RKN43 = exact(0, "1/4", "7/10", 1)

R = root(8581)
DPRKN6 = (Fraction(0), (209 - R) / 900, (209 - R) / 450, (209 + R) / 450, Fraction(9, 10), Fraction(1))
DPRKN6_LAST = (
    Fraction(329, 4212), Fraction(0), (84119543 + 366727 * R) / 409622616, (84119543 - 366727 * R) / 409622616,
    Fraction(200, 17901),
)

DPRKN8 = exact(0, "1/20", "1/10", "3/10", "1/2", "7/10", "9/10", 1, 1)
DPRKN8_BBAR = exact("223/7938", 0, "1175/8064", "925/6048", "41/448", "925/14112", "1175/72576", 0, 0)
DPRKN8_B = exact(
    "223/7938", 0, "5875/36288", "4625/21168", "41/224", "4625/21168", "5875/36288", "223/7938", 0
)
DPRKN8_INTERPOLATED = interpolated(DPRKN8, (0, 2, 3, 4, 5, 6, 7))
DPRKN8_VELOCITIES = (
    *DPRKN8_INTERPOLATED[:3],
    exact(
        "131137/5439000", 0, "291349/1657600", "688319/5801600", "-53217/2072000", "53769/5801600", "-14323/4972800",
        "1409/1813000", 0,
    ),
    DPRKN8_INTERPOLATED[4],
    exact(
        "573053/20979000", 0, "3160603/19180800", "4681891/22377600", "61781/296000", "2234341/22377600",
        "-265967/19180800", "83543/20979000", 0,
    ),
    DPRKN8_INTERPOLATED[6],
    DPRKN8_B,
    DPRKN8_B,
)
"""Those of stages 4 and 6 are the ones nearest to the interpolated ones that meet the conditions of order 8 for rates
linear in v; each has an error O(h**6)."""

FINE5_BBAR = exact("4817/51600", 0, "388869/1216880", "3276/23575", "-1142053/22015140", 0)
FINE5_B = exact("4817/51600", 0, "1685099/3650640", "19656/23575", "-53676491/88060560", "53/240")

NYSTROM = (
    Nystrom(
        name="nystrom4",
        order=4,
        source="Nyström 1925, Acta Soc. Sci. Fennicae 50, no. 13",
        summary="order 4 from three forces, one less than rk4",
        velocity_free=True,
        c=NYSTROM4,
        a=triangle(exact("1/8"), exact(0, "1/2")),
        bbar=exact("1/6", "1/3", 0),
        b=exact("1/6", "2/3", "1/6"),
        av=interpolated(NYSTROM4, (0, 1, 2)),
    ),
    Nystrom(
        name="rkn43",
        aliases=("dprkn4",),
        order=4,
        source="Dormand, El-Mikkawy & Prince 1987, IMA J. Numer. Anal. 7, 235, RKN4(3)4FM",
        summary="order 4 from three forces, with an estimate of order 3 at no cost",
        velocity_free=True,
        c=RKN43,
        a=triangle(exact("1/32"), exact("7/1000", "119/500"), exact("1/14", "8/27", "25/189")),
        bbar=exact("1/14", "8/27", "25/189", 0),
        b=exact("1/14", "32/81", "250/567", "5/54"),
        av=interpolated(RKN43, (0, 1, 2, 3)),
        embedded=(
            EmbeddedNystrom(
                3, exact("-7/150", "67/150", "3/20", "-1/20"), exact("13/21", "-20/27", "275/189", "-1/3")
            ),
        ),
    ),
    Nystrom(
        name="dprkn6",
        order=6,
        source="Dormand & Prince 1987, Comput. Math. Appl. 13, 937, RKN6(4)6FD",
        summary="order 6 from five forces, with an estimate of order 4 at no cost",
        velocity_free=True,
        c=DPRKN6,
        a=triangle(
            ((26131 - 209 * R) / 810000,),
            ((26131 - 209 * R) / 607500, (26131 - 209 * R) / 303750),
            (
                (980403512254 + 7781688431 * R) / 11694469921875, -(1262884486208 + 15385481287 * R) / 11694469921875,
                (7166233891441 + 78694563299 * R) / 46777879687500,
            ),
            (
                -9 * (329260 + 3181 * R) / 27040000, 27 * (35129 + 3331 * R) / 13520000,
                -27 * (554358343 + 31040327 * R) / 464060480000, 153 * (8555257 - 67973 * R) / 2745920000,
            ),
            DPRKN6_LAST,
        ),
        bbar=(*DPRKN6_LAST, Fraction(0)),
        b=(
            Fraction(329, 4212), Fraction(0), (389225579 + 96856 * R) / 1024056540,
            (389225579 - 96856 * R) / 1024056540, Fraction(2000, 17901), Fraction(1, 20),
        ),
        av=interpolated(DPRKN6, (0, 2, 3, 4, 5)),
        embedded=(
            EmbeddedNystrom(
                4,
                ((2701 + 23 * R) / 4563, -(9829 + 131 * R) / 9126, 5 * (1798 + 17 * R) / 9126, *exact(0, 0, 0)),
                (
                    Fraction(115, 2106), Fraction(0), (84119543 + 366727 * R) / 256014135,
                    (84119543 - 366727 * R) / 256014135, Fraction(6950, 17901), Fraction(-1, 10),
                ),
            ),
        ),
    ),
    Nystrom(
        name="dprkn8",
        order=8,
        source="Dormand, El-Mikkawy & Prince 1987, IMA J. Numer. Anal. 7, 423, RKN8(6)9FM",
        summary="order 8 from eight forces; with the next step's first one an estimate of order 6",
        velocity_free=True,
        c=DPRKN8,
        a=triangle(
            exact("1/800"),
            exact("1/600", "1/300"),
            exact("9/200", "-9/100", "9/100"),
            exact("-66701/197352", "28325/32892", "-2665/5482", "2170/24669"),
            exact("227015747/304251000", "-54897451/30425100", "12942349/10141700", "-9499/304251", "539/9250"),
            exact(
                "-1131891597/901789000", "41964921/12882700", "-6663147/3220675", "270954/644135", "-108/5875",
                "114/1645",
            ),
            exact(
                "13836959/3667458", "-17731450/1833729", "1063919505/156478208", "-33213845/39119552", "13335/28544",
                "-705/14272", "1645/57088",
            ),
            DPRKN8_BBAR[:8],
        ),
        bbar=DPRKN8_BBAR,
        b=DPRKN8_B,
        av=DPRKN8_VELOCITIES,
        embedded=(
            EmbeddedNystrom(
                6,
                exact(
                    "7987313/109941300", 0, "1610737/44674560", "10023263/33505920", "-497221/12409600",
                    "10023263/78180480", "1610737/402071040", 0, 0,
                ),
                exact(
                    "7987313/109941300", 0, "1610737/40207104", "10023263/23454144", "-497221/6204800",
                    "10023263/23454144", "1610737/40207104", "-4251941/54970650", "3/20",
                ),
            ),
        ),
    ),
    Nystrom(
        name="fine4",
        order=4,
        source="Fine 1987, Computing 38, 281, the pair of order 4",
        summary="order 4 from five forces that may depend on the velocity, with an estimate of order 3",
        c=exact(0, "2/9", "1/3", "3/4", 1),
        a=triangle(
            exact("2/81"), exact("1/36", "1/36"), exact("9/128", 0, "27/128"), exact("11/60", "-3/20", "9/25", "8/75")
        ),
        av=triangle(
            exact("2/9"), exact("1/12", "1/4"), exact("69/128", "-243/128", "135/64"),
            exact("-17/12", "27/4", "-27/5", "16/15"),
        ),
        bbar=exact("19/180", 0, "63/200", "16/225", "1/120"),
        b=exact("1/9", 0, "9/20", "16/45", "1/12"),
        embedded=(
            EmbeddedNystrom(
                3, exact("119/930", 0, "819/3100", "272/2325", "-17/1860"),
                exact("143/1125", 0, "1017/2500", "2288/5625", "89/1500"),
            ),
        ),
    ),
    Nystrom(
        name="fine5",
        order=5,
        source="Fine 1987, Computing 38, 281, the pair of order 5",
        summary="order 5 from six forces that may depend on the velocity; with the next step's first one an estimate",
        c=exact(0, "8/39", "4/13", "5/6", "43/47", 1, 1),
        a=triangle(
            exact("32/1521"),
            exact("4/169", "4/169"),
            exact("175/5184", 0, "1625/5184"),
            exact("-342497279/5618900760", "6827067/46824173", "35048741/102161832", "-2201514/234120865"),
            exact("-7079/52152", "767/2173", "14027/52152", "30/2173", 0),
            FINE5_BBAR,
        ),
        av=triangle(
            exact("8/39"),
            exact("1/13", "3/13"),
            exact("7385/6912", "-9425/2304", "13325/3456"),
            exact("223324757/91364240", "-174255393/18272848", "382840094/46824173", "-39627252/234120865"),
            exact("108475/36464", "-9633/848", "7624604/806183", "8100/49979", "-4568212/19446707"),
            FINE5_B,
        ),
        bbar=(*FINE5_BBAR, Fraction(0)),
        b=(*FINE5_B, Fraction(0)),
        embedded=(
            EmbeddedNystrom(
                4,
                exact(
                    "5705201/63210000", 0, "487384677/1490678000", "3426228/28879375", "-966881509/26968546500", 0, 0
                ),
                exact(
                    "5705201/63210000", 0, "704000089/1490678000", "20557368/28879375", "-45443430923/107874186000",
                    "31429/294000", "1/25",
                ),
            ),
        ),
    ),
)
