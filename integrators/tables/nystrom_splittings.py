"""Splittings whose order holds for velocity-free forces only: Nyström methods, which meet fewer order conditions.

There are no symmetric ones of order 4: for them, velocity-free forces drop conditions only from order 5 on.

The last kick and drift, or the middle ones, follow from the sums. The fractions are solutions of the order conditions
in 60 digits, rounded to 40 places; among several solutions the one nearest to the published digits.
"""

from __future__ import annotations

from integrators.families.splitting import DRIFT, KICK, Splitting
from integrators.tables.flows import alternating, mirrored

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
