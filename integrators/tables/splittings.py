"""Splitting methods: Euler and Verlet, splittings for any two flows, and those for velocity-free forces only.

Published tables list kicks and drifts. If they have order p for any two flows, their numbers also give a method of
order p from any basic step and its adjoint (McLachlan 1995, SIAM J. Sci. Comput. 16, 151; Hairer, Lubich & Wanner 2006,
section III.3): each kick is divided in two, and drag acts between the parts. This needs no more force evaluations, and
without drag the two parts are one kick again. Like kicks, drag flows can have negative fractions of the step. The only
method that includes drag explicitly in the kick is ``symplectic_euler``, as the lab exercise does.

Nyström methods (NYSTROM_SPLITTINGS) meet the fewer order conditions of velocity-free forces. There are no symmetric
ones of order 4: for them, velocity-free forces drop conditions only from order 5 on.

The last kick and drift, or the middle ones, follow from the sums. The fractions are solutions of the order conditions
in 60 digits, rounded to 40 places; among several solutions the one nearest to the published digits. ``mclachlan_s2``
begins with 1/2 - s/12 + 1/(6 s), s**3 = 36 + 2 sqrt(326).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import cycle

from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH, Splitting
from integrators.method import exact, total

Flows = tuple[tuple[str, Fraction], ...]
Number = int | str | Fraction
OTHER = {KICK: DRIFT, DRIFT: KICK}


def alternating(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """Return a splitting of alternating kicks and drifts that begins with the kind ``first``.

    ``outer`` has the fractions of that kind, ``inner`` those of the other kind.

    One more kick and one more drift are added, so that the fractions of each kind sum to 1.
    """
    rows = ((*part, 1 - total(part)) for part in (exact(*outer), exact(*inner)))
    return _interleaved(first, *rows)


def mirrored(first: str, outer: Sequence[Number], inner: Sequence[Number]) -> Flows:
    """Return a symmetric splitting, kicks and drifts in turn, from the fractions of its first half.

    ``outer`` has the fractions of the kind ``first``, ``inner`` those of the other kind. The middle flow and the two
    next to it follow, because the fractions of each kind sum to 1. The middle flow is of the kind ``first`` if
    ``outer`` is longer than ``inner``, and of the other kind if both have the same length.
    """
    outside, inside = exact(*outer), exact(*inner)
    outer_middle = len(outside) > len(inside)
    alone, paired = (outside, inside) if outer_middle else (inside, outside)
    middle, last = 1 - 2 * total(alone), Fraction(1, 2) - total(paired)
    lone, pairs = (*alone, middle, *alone[::-1]), (*paired, last, last, *paired[::-1])
    rows = (lone, pairs) if outer_middle else (pairs, lone)
    return _interleaved(first, *rows)


def composed(*gammas: Number) -> Flows:
    """Return a symmetric composition of velocity Verlet steps, as kicks and drifts.

    ``gammas`` are the lengths of the steps before the middle one, as fractions of the whole step.
    """
    half = exact(*gammas)
    drifts = (*half, 1 - 2 * total(half), *half[::-1])
    kicks = [(x + y) / 2 for x, y in zip((Fraction(0), *drifts), (*drifts, Fraction(0)), strict=True)]
    return _interleaved(KICK, kicks, drifts)


def _interleaved(first: str, outer: Sequence[Fraction], inner: Sequence[Fraction]) -> Flows:
    """Return kicks and drifts in turn, as pairs (kind, fraction of the step), beginning with the kind ``first``.

    ``outer`` are its fractions, ``inner`` those of the other kind: equally many, or one fewer.
    """
    kinds, turns = cycle((first, OTHER[first])), cycle((iter(outer), iter(inner)))
    return tuple((next(kinds), next(next(turns))) for _ in range(len(outer) + len(inner)))


def with_drag(flows: Flows) -> Flows:
    """Insert exact drag flows into a splitting of kicks and drifts.

    The orders ``drag, kick, drift`` and ``drift, kick, drag`` then alternate. Neighbouring drifts are combined.
    :func:`integrators.unroll` combines neighbouring drags if they are exact flows.
    """
    parts: list[tuple[str, Fraction]] = []
    left = Fraction(0)
    for kind, fraction in flows:
        rest = fraction - left
        if kind == DRIFT:
            parts.append((DRIFT, fraction))
        else:
            parts += [(KICK, left), (DRAG, left), (DRAG, rest), (KICK, rest)]
        left = rest
    return tuple(flow for flow in parts if flow[1])


GENERAL = (
    Splitting(
        name="mclachlan_atela2",
        order=2,
        source="McLachlan & Atela 1992, Nonlinearity 5, 541",
        summary="two kicks: the smallest error of all such methods of order 2",
        flows=with_drag(alternating(
            KICK,
            ("0.2928932188134524755991556378951509607152",),
            ("0.7071067811865475244008443621048490392848",),
        )),
    ),
    Splitting(
        name="mclachlan_s2",
        aliases=("omelyan_babab",),
        order=2,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151; Omelyan, Mryglod & Folk 2002",
        summary="three kicks and two drifts, placed for the smallest error",
        flows=with_drag(mirrored(
            KICK,
            ("0.1931833275037835739628997650268340356481",),
            (),
        )),
    ),
    Splitting(
        name="ruth3",
        order=3,
        source="Ruth 1983, IEEE Trans. Nucl. Sci. 30, 2669",
        summary="the first symplectic method of order 3, in simple fractions",
        flows=with_drag(alternating(
            KICK,
            ("7/24", "3/4"),
            ("2/3", "-2/3"),
        )),
    ),
    Splitting(
        name="mclachlan_atela3",
        order=3,
        source="McLachlan & Atela 1992, Nonlinearity 5, 541",
        summary="three kicks: the smallest error of all such methods of order 3",
        flows=with_drag(alternating(
            KICK,
            ("0.2683300957817599249569552299254991394812", "-0.1879916187991597820078528680788819290445"),
            ("0.9196615230173998570508976381533827895633", "-0.1879916187991597820078528680788819290445"),
        )),
    ),
    Splitting(
        name="mclachlan_s4",
        order=4,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="four drifts: a free parameter chosen for a small error",
        flows=with_drag(mirrored(
            KICK,
            ("0.1691392799220720451750024659651743352139", "-0.2991862039040507995086317151194278942115"),
            ("6/11",),
        )),
    ),
    Splitting(
        name="mclachlan_s5",
        order=4,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="five drifts, two free parameters chosen for a small error",
        flows=with_drag(mirrored(
            KICK,
            ("0.0892694542264752448866946112605591142672", "-0.0973360426368955080153599433983084223515"),
            ("2/5", "-1/10"),
        )),
    ),
    Splitting(
        name="pefrl",
        order=4,
        source="Omelyan, Mryglod & Folk 2002, Comput. Phys. Commun. 146, 188, eq. 20-22",
        summary="position-extended Forest-Ruth-like: one force more than forest_ruth, far smaller error",
        flows=with_drag(mirrored(
            DRIFT,
            ("0.1786178958448090670599037670811929908869", "-0.0662645826698184962780156217646024122388"),
            ("0.7123418310626054038318904580688415628511",),
        )),
    ),
    Splitting(
        name="vefrl",
        order=4,
        source="Omelyan, Mryglod & Folk 2002, Comput. Phys. Commun. 146, 188",
        summary="velocity-extended Forest-Ruth-like: like pefrl, but it starts and ends with a kick",
        flows=with_drag(mirrored(
            KICK,
            ("0.1644986515575759720216332117996808409836", "1.2356926511389169997626454809045568965789"),
            ("0.5209433391039898810671612763465936256518",),
        )),
    ),
    Splitting(
        name="blanes_moan_s6",
        order=4,
        source="Blanes & Moan 2002, J. Comput. Appl. Math. 142, 313, table 2",
        summary="six drifts, three free parameters chosen for the smallest error",
        flows=with_drag(mirrored(
            KICK,
            (
                "0.0792036964311956694336634958882741607137", "0.3531729060497739884810613115731132948018",
                "-0.0420650803577195353681102983025129563170",
            ),
            ("0.2095151066133620212740726400295074506536", "-0.1438517731798180082751150578565373599003"),
        )),
    ),
    Splitting(
        name="mclachlan_sb3a4",
        order=4,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="four kicks of simple fractions, chosen for velocity-free forces",
        flows=with_drag(mirrored(
            DRIFT,
            ("0.1881952177688382178680209389736208915203", "-0.0215285511021715512013542723069542248537"),
            ("1",),
        )),
    ),
    Splitting(
        name="mclachlan_sb3a5",
        order=4,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="five kicks of simple fractions, chosen for velocity-free forces",
        flows=with_drag(mirrored(
            DRIFT,
            ("0.4051886183952522772205531983898517327134", "-0.2871440408165240889966277933622274550686"),
            ("-3/73", "17/59"),
        )),
    ),
    Splitting(
        name="blanes_moan_srkn6b",
        order=4,
        source="Blanes & Moan 2002, J. Comput. Appl. Math. 142, 313, table 3",
        summary="six drifts, three free parameters chosen for the smallest error under velocity-free forces",
        flows=with_drag(mirrored(
            KICK,
            (
                "0.0829844064174050188383474789422492288154", "0.3963098014983680770949115282636541758401",
                "-0.0390563049223484351708652907653612203580",
            ),
            ("0.2452989571842711626039324260013989116902", "0.6048726657110799749608926976430882273685"),
        )),
    ),
    Splitting(
        name="blanes_moan_s10",
        order=6,
        source="Blanes & Moan 2002, J. Comput. Appl. Math. 142, 313, table 2",
        summary="ten drifts, a free parameter chosen for the smallest error",
        flows=with_drag(mirrored(
            KICK,
            (
                "0.0502627644003926860212216544024695780195", "0.4135143004283438150630637201302507609349",
                "0.0450798897943980629688970521250357013144", "-0.1880548538195689147991284889156813779194",
                "0.5419606784507801348314147409317544131735",
            ),
            (
                "0.1488164479010432319209010055360999855680", "-0.1323858657677836474488454266001098628699",
                "0.0673076046921844581502578965919670052908", "0.4326664025781735975276679708847734177129",
            ),
        )),
    ),
)


ONE, HALF = Fraction(1), Fraction(1, 2)

SPLITTING = (
    Splitting(
        name="symplectic_euler",
        aliases=("semi_implicit_euler", "euler_cromer"),
        order=1,
        source="Cromer 1981, Am. J. Phys. 49, 455; de Vogelaere 1956",
        summary="velocity first, then the angle with the new velocity; drag is explicit in the kick",
        flows=((PUSH, ONE), (DRIFT, ONE)),
    ),
    Splitting(
        name="symplectic_euler_position_first",
        order=1,
        source="Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, eq. I.1.9",
        summary="angle first, then the velocity at the new angle, then the exact drag flow",
        flows=((DRIFT, ONE), (KICK, ONE), (DRAG, ONE)),
    ),
    Splitting(
        name="conformal_symplectic_euler",
        order=1,
        source="McLachlan & Quispel 2002, Acta Numerica 11, 341, section 3.9; Bhatt, Floyd & Moore 2016",
        summary="exact drag flow, then symplectic Euler: phase-space area shrinks at exactly the true rate",
        flows=((DRAG, ONE), (KICK, ONE), (DRIFT, ONE)),
    ),
    Splitting(
        name="velocity_verlet",
        aliases=("verlet", "leapfrog", "stoermer", "stoermer_verlet"),
        order=2,
        source="Verlet 1967, Phys. Rev. 159, 98; Swope et al. 1982, J. Chem. Phys. 76, 637",
        summary="half kick, drift, half kick, with half an exact drag flow at either end; one force per step",
        flows=((DRAG, HALF), (KICK, HALF), (DRIFT, ONE), (KICK, HALF), (DRAG, HALF)),
    ),
)


NYSTROM_SPLITTINGS = (
    Splitting(
        name="mclachlan_atela4",
        order=4,
        source="McLachlan & Atela 1992, Nonlinearity 5, 541",
        summary="four kicks, not symmetric, chosen for the smallest error",
        nystrom=True,
        flows=alternating(
            KICK,
            (
                "0.1344961992774310892054809431852855697448", "-0.2248198030794208058165468473203658177254",
                "0.7563200005156682911117458459583165252647",
            ),
            (
                "0.5153528374311229364003552984351251138878", "-0.0857820194129736460702687337735938473690",
                "0.4415830236164665242530754763585267217823",
            ),
        ),
    ),
    Splitting(
        name="calvo_sanz_serna4",
        order=4,
        source="Calvo & Sanz-Serna 1993, SIAM J. Sci. Comput. 14, 936",
        summary="five kicks; the last force is the first one of the next step; not symmetric, small error",
        nystrom=True,
        flows=alternating(
            KICK,
            (
                "0.0617588581356287035150932482970588643645", "0.3389780265536421159176675995758265302754",
                "0.6147913071755779564837921826376471180005", "-0.1405480146593750521041970662312772294692",
            ),
            (
                "0.2051776615422891534384457309309630664255", "0.4030212816042119539197535542128522209659",
                "-0.1209208763389117893817510344123814007738",
            ),
        ),
    ),
    Splitting(
        name="mclachlan_atela5",
        order=5,
        source="McLachlan & Atela 1992, Nonlinearity 5, 541",
        summary="six kicks, not symmetric, because the order is odd",
        nystrom=True,
        flows=alternating(
            KICK,
            (
                "0.1193900292875672757946281940912547683322", "0.6989273703824752308350184318446527170232",
                "-0.1713123582716007754078931650031238863914", "0.4012695022513534479958229765850542221006",
                "0.0107050818482359839874241910649002139375",
            ),
            (
                "0.3398396258391100000002614600170103469640", "-0.0886013369030273286523585603442043350387",
                "0.5858564768259621188099053162882869413172", "-0.6030393565364918881979362966665710846937",
                "0.3235807965546976393249575061867187831892",
            ),
        ),
    ),
    Splitting(
        name="okunbor_skeel6",
        order=6,
        source="Okunbor & Skeel 1994, J. Comput. Appl. Math. 51, 375, method 13",
        summary="seven kicks: the fewest forces for order 6",
        nystrom=True,
        flows=mirrored(
            DRIFT,
            (
                "-1.0130879789171747298149045784889559086392", "1.1874295737325427070242933206374022004906",
                "-0.0183358520964605903443874884097306084136",
            ),
            (
                "0.0001660069265000989421747072427969753415", "-0.3796242142637736060819469079990920603818",
                "0.6891374118518106367408016646578030366064",
            ),
        ),
    ),
    Splitting(
        name="blanes_moan_srkn11b",
        order=6,
        source="Blanes & Moan 2002, J. Comput. Appl. Math. 142, 313, table 3",
        summary="eleven drifts, chosen for the smallest error",
        nystrom=True,
        flows=mirrored(
            KICK,
            (
                "0.0414649985182628432987781339149228399049", "0.1981286719180665411367264731801322925719",
                "-0.0400061921041526868888283635360550075046", "0.0752539843015803411278788785261110354942",
                "-0.0115113874206877700624432015008829986147",
            ),
            (
                "0.1232297759462711515610863803334455073311", "0.2905537977995582703664141693278346908160",
                "-0.1270492126254169156625050538303351826636", "-0.2463317610620754041949734891029659245037",
                "0.3572088727959277526198603496207197273502",
            ),
        ),
    ),
    Splitting(
        name="blanes_moan_srkn14a",
        order=6,
        source="Blanes & Moan 2002, J. Comput. Appl. Math. 142, 313, table 3",
        summary="fourteen kicks, chosen for the smallest error",
        nystrom=True,
        flows=mirrored(
            DRIFT,
            (
                "0.0378593198406109414470211791153073209390", "0.1026356331024365528470822509694730005061",
                "-0.0258678882665583331639469603741284505989", "0.3142414030714464341471425358032525673622",
                "-0.1301444595174151138496150786066283046162", "0.1064177003695413680222801392559845976540",
                "-0.0087942431285102043940694284069219710803",
            ),
            (
                "0.0917191526244620179811832284001052652648", "0.1839831700050048984914765646783172389071",
                "-0.0565343658328891043952770448623663495319", "0.0049146887747118856402056164383839970900",
                "0.1437611271683616823873745299676127340817", "0.3285676937468041402004812576216097642835",
            ),
        ),
    ),
)
