"""Symmetric compositions of velocity Verlet: steps of different lengths, some backwards, whose errors cancel.

Each table holds the lengths before the middle step; the middle one follows from the sum, and the rest by symmetry.
They are solutions of the order conditions in 60 digits, rounded to 40 places; among several solutions the one nearest
to the published digits.
"""

from __future__ import annotations

from integrators.families.splitting import Splitting
from integrators.tables.splittings import composed, with_drag

COMPOSITIONS = (
    Splitting(
        name="forest_ruth",
        aliases=("candy_rozmus4", "yoshida4"),
        order=4,
        source="Forest & Ruth 1990, Physica D 43, 105; Candy & Rozmus 1991, J. Comput. Phys. 92, 230",
        summary="three Verlet steps, the middle one far backwards: the fewest forces for order 4",
        flows=with_drag(composed("1.3512071919596576340476878089714608269220")),
    ),
    Splitting(
        name="suzuki4",
        aliases=("kahan_li4",),
        order=4,
        source="Suzuki 1990, Phys. Lett. A 146, 319",
        summary="five Verlet steps, four of them equal: shorter steps backwards and smaller error than forest_ruth",
        flows=with_drag(composed(
            "0.4144907717943757371423540628607614957118", "0.4144907717943757371423540628607614957118",
        )),
    ),
    Splitting(
        name="mclachlan_ss5",
        order=4,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="five Verlet steps, the first chosen for a small error",
        flows=with_drag(composed("0.28", "0.6254664284676700450123389054926490129182")),
    ),
    Splitting(
        name="yoshida6a",
        order=6,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 1, solution A",
        summary="seven Verlet steps: the usual solution for order 6",
        flows=with_drag(composed(
            "0.7845136104775572638194976338663498757768", "0.2355732133593581336847931829785346016865",
            "-1.1776799841788710069464156809643157346393",
        )),
    ),
    Splitting(
        name="yoshida6b",
        order=6,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 1, solution B",
        summary="seven Verlet steps, with longer steps backwards than yoshida6a",
        flows=with_drag(composed(
            "1.4398481679767830909304992814790231821071", "0.0042606818707920161960837138286697913321",
            "-2.1322852220014515207059933722207962878542",
        )),
    ),
    Splitting(
        name="yoshida6c",
        order=6,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 1, solution C",
        summary="seven Verlet steps, the longest in the middle; larger error than yoshida6a",
        flows=with_drag(composed(
            "1.4477825623992979328978966632989267382363", "-2.1440353163053893106013018066598891940697",
            "0.0015288622842492702522672386172055917578",
        )),
    ),
    Splitting(
        name="kahan_li6",
        order=6,
        source="Kahan & Li 1997, Math. Comp. 66, 1089",
        summary="nine Verlet steps, one parameter free, chosen for small steps",
        flows=with_drag(composed(
            "0.3921614440073141392792505574226714038049", "0.3325991367893594385997486375000496468816",
            "-0.7062461725576393598099648195492564593955", "0.0822135962935508002314904481020563311033",
        )),
    ),
    Splitting(
        name="mclachlan_ss9",
        order=6,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="nine Verlet steps, the first chosen for a small error",
        flows=with_drag(composed(
            "0.1867", "0.5554970237124783991569135436283912009641", "0.1294669489134753580560452092102047808168",
            "-0.8432656233877346085491427813848149898690",
        )),
    ),
    Splitting(
        name="yoshida8a",
        order=8,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 2, solution A",
        summary="fifteen Verlet steps, some longer than twice the whole step: only for small h",
        flows=with_drag(composed(
            "1.0424262086997042643489532683976564761056", "1.8202063097069800693317331661213997808094",
            "0.1577399281237083213428257830795420048405", "2.4400273261663440638168958976194309435378",
            "-0.0071698941970953320998061292496491094812", "-2.4469918237042458892946914523814624845608",
            "-1.6158237415006537847879401974587421658972",
        )),
    ),
    Splitting(
        name="yoshida8b",
        order=8,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 2, solution B",
        summary="fifteen Verlet steps, the longest three times the whole step",
        flows=with_drag(composed(
            "1.4881922920292131008017083430693971224504", "-2.3386481510104194309775575246107293056204",
            "2.8910514897219890006135903455603666547479", "-2.8968825033042398685893233005790814396048",
            "0.0037803958836266822368707084347105226561", "2.8919574431581739124797329685888815794016",
            "-0.0016924858777170655917021655257990566679",
        )),
    ),
    Splitting(
        name="yoshida8c",
        order=8,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 2, solution C",
        summary="fifteen Verlet steps, the longest 1.7 times the whole step",
        flows=with_drag(composed(
            "0.6290306502103707998984046604257841744873", "1.3693494641688177005561475694698782371529",
            "-1.0645871478918250705351249218874104716760", "1.6633580996335051797576573906060084400352",
            "-1.6789692825967384712126131251103781382704", "-1.5594680382147025882093947275670151626994",
            "0.3117908124184667725520545822806452091149",
        )),
    ),
    Splitting(
        name="yoshida8d",
        order=8,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 2, solution D",
        summary="fifteen Verlet steps: the most accurate of the five methods yoshida8a to yoshida8e",
        flows=with_drag(composed(
            "0.9148442462297915667487934898475096045181", "0.2536933365662113541461460206899420760977",
            "-1.4448522368606051576947306575373903549559", "-0.1582406353680501752040667767597542477554",
            "1.9381391376225259865791864874436417609536", "-1.9606102329753108076076333763996636407924",
            "0.1027998493917964406981151316012258629110",
        )),
    ),
    Splitting(
        name="yoshida8e",
        order=8,
        source="Yoshida 1990, Phys. Lett. A 150, 262, table 2, solution E",
        summary="fifteen Verlet steps, the longest 2.7 times the whole step",
        flows=with_drag(composed(
            "1.3030016575751683849056350273891142046923", "0.1079904677180982796054062910782108600611",
            "-2.0480979588349020564425515896306252573016", "0.0053601892137523808348965288898597301246",
            "-0.0719180053650705074781012549420280136771", "2.5277892731802833918276284507412911402097",
            "0.0227738840126312259834908659825195849871",
        )),
    ),
    Splitting(
        name="suzuki_umeno8",
        aliases=("mclachlan_ss15",),
        order=8,
        source="Suzuki & Umeno 1993; McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="fifteen Verlet steps, none longer than the whole step: the fewest forces for order 8",
        flows=with_drag(composed(
            "0.7416703643506129534482278017838063156035", "-0.4091008258000315939973000958935634173099",
            "0.1907547102962383799538762564503716627355", "-0.5738624711160822666563877266355357421595",
            "0.2990641813036559238444635406886029882258", "0.3346249182452981837849579798821822886337",
            "0.3152930923967665966320566638110024309941",
        )),
    ),
    Splitting(
        name="mclachlan_ss17",
        order=8,
        source="McLachlan 1995, SIAM J. Sci. Comput. 16, 151",
        summary="seventeen Verlet steps, the first chosen for a small error",
        flows=with_drag(composed(
            "25/194", "0.5815140871052509624302422782038136910044", "-0.4101753714698501375324061500890486599642",
            "0.1851469357165877326532719498634894574402", "-0.4095523434208514193398451736889092696187",
            "0.1444059410800120410600751871569277490622", "0.2783355003936796513091070628124172294800",
            "0.3149566839162948578902813119729508819232",
        )),
    ),
    Splitting(
        name="kahan_li8",
        order=8,
        source="Kahan & Li 1997, Math. Comp. 66, 1089",
        summary="seventeen Verlet steps, one parameter free, chosen for small steps: for long and exact runs",
        flows=with_drag(composed(
            "0.1302024830888900808788176320967005223573", "0.5611629817751083845619644077001505672662",
            "-0.3894749626448472864080785982352483888362", "0.1588419065551556008962107457071524814121",
            "-0.3959038941332375773362315393479389360267", "0.1845396409783157070918325415333754628189",
            "0.2583743876863220472939791099949394718130", "0.2950117236093102988709662402182281129766",
        )),
    ),
    Splitting(
        name="tsitouras10",
        aliases=("hlw_s33",),
        order=10,
        source="Tsitouras 1999, Celest. Mech. Dyn. Astron. 74, 223; Hairer, Lubich & Wanner 2006, V.3.2",
        summary="thirty-three Verlet steps",
        flows=with_drag(composed(
            "0.1231352687098299408278201863200955681128", "0.7764498169693731051988357046021386762416",
            "0.1490549007956704561283611215355961202157", "-0.1725076121939374442025344373050572949635",
            "-0.5487124081880017794167517843286126185262", "0.1428976542184184210012999069948724387991",
            "-0.3141919326398686199747991064138971694291", "0.1267094373956104102223197257669983712660",
            "0.1744473458418131299790230536749703387089", "0.4431854466542857292869203242106936552547",
            "-0.8194890056829908441871436848507103867550", "0.1338254573848958301982614099474947300420",
            "0.6450902352441060501967722866966740597025", "-0.7193633716992206071926054482716871772179",
            "0.2095138181346364968190725356625339774976", "-0.2682811314063605196616907683424975365661",
        )),
    ),
    Splitting(
        name="sofroniou_spaletta10",
        order=10,
        source="Sofroniou & Spaletta 2005, Optim. Methods Softw. 20, 597",
        summary="thirty-five Verlet steps, none longer than 0.42 of the whole step",
        flows=with_drag(composed(
            "0.0787957225216864192639076793376842482990", "0.3130961034151085277648124719264726960941",
            "0.0279183832350780661095202732752988219347", "-0.2295928415939070941512133967965498764898",
            "0.1309620610771648631746568592796054142647", "-0.2697334056545107143446097322241114962508",
            "0.0749733431558914356661371056414104120489", "0.1119934239998102048895750807364020588253",
            "0.3661334495462267511931481235314990830901", "-0.3991056301360358978786298105834047304730",
            "0.1030873985274710773158027700137244767471", "0.4114308739558902378207041189760783506842",
            "-0.0048663605831352617621956593099770627375", "-0.3920333537086399064480819364261042701845",
            "0.0519425029624496470371829040159758133790", "0.0506650907599244963358743441568657970357",
            "0.0496743706397298790545688002794609337169",
        )),
    ),
)
