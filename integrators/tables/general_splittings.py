"""Splittings of order 2 to 6 for any two flows, by their kicks and drifts.

The last kick and drift, or the middle ones, follow from the sums. The fractions are solutions of the order conditions
in 60 digits, rounded to 40 places; among several solutions the one nearest to the published digits. ``mclachlan_s2``
begins with 1/2 - s/12 + 1/(6 s), s**3 = 36 + 2 sqrt(326).
"""

from __future__ import annotations

from integrators.families.splitting import DRIFT, KICK, Splitting
from integrators.tables.flows import alternating, mirrored, with_drag

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
