"""The quantities that columns of files hold: the words that name them, their units, how they are read, and the remedy.

:data:`QUANTITIES` is the one list from which titles are recognised, refusals are written, and the table of formats is
made.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

STANDARD = 9.80665
"""Standard gravity [m/s²], the unit g of accelerometers (CGPM 1901)."""


def pattern(words: Iterable[str]) -> re.Pattern[str]:
    """Return a regular expression that finds one of several words in a title, without regard to case.

    A word ends where a letter begins or ends, unless it has a star there: "*theta*" is found in "thetadot", "theta" is
    not. A blank stands for any number of blanks, "_" and "-", a star inside a word for letters. Spaces may surround a
    slash. A word in brackets must stand in round or square brackets.
    """
    forms = []
    for word in words:
        bare = word.strip("*()")
        form = re.escape(bare).replace(r"\ ", "[ _-]*").replace("/", r"\s*/\s*").replace(r"\*", r"\w*")
        if word.startswith("("):
            forms.append(rf"[(\[,]\s*{form}\s*[)\]]")
        else:
            forms.append(f"{'' if word[0] == '*' else '(?<![a-z])'}{form}{'' if word[-1] == '*' else '(?![a-z])'}")
    return re.compile("|".join(forms), re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Unit:
    """A unit of a quantity: its size in SI units, and the words that name it in a title."""

    size: float
    words: tuple[str, ...]

    @cached_property
    def form(self) -> re.Pattern[str]:
        """Regular expression of the words."""
        return pattern(self.words)


@dataclass(frozen=True, eq=False)
class Quantity:
    """A quantity that a column may hold.

    Attributes:
        name: the quantity with its article.
        words: words that name it in titles, in the notation of :func:`pattern`.
        units: its units by name.
        reading: how a recording with this quantity is read; "" if it is refused.
        remedy: the advice of a refusal, or of the option that chooses the quantity.
        files: programs and devices that write it.
    """

    name: str
    words: tuple[str, ...]
    units: Mapping[str, Unit] = field(default_factory=dict)
    reading: str = ""
    remedy: str = ""
    files: str = ""

    @cached_property
    def form(self) -> re.Pattern[str]:
        """Regular expression of the words."""
        return pattern(self.words)

    def names(self, title: str) -> bool:
        """Return True if a title has one of the quantity's words."""
        return self.form.search(title) is not None

    def units_in(self, titles: Iterable[str]) -> set[str]:
        """Return the names of the units that titles contain."""
        return {name for title in titles for name, unit in self.units.items() if unit.form.search(title)}

    def refusal(self, title: str) -> str:
        """Return a sentence that refuses a column with a title, and gives the remedy."""
        return f"{title!r} is {self.name}: {self.remedy}"

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Row of the table of formats: the quantity, words, units, and how it is read or refused."""
        words = ", ".join(dict.fromkeys(word.replace("*", "") for word in self.words if word.isascii())) or "-"
        read = self.reading if self.reading else f"refused: {self.remedy}"
        read = f"{read}; {self.remedy}" if self.reading and self.remedy else read
        bare = self.name.removeprefix("an ").removeprefix("a ")
        return bare, words, ", ".join(self.units) or "-", read + (f" ({self.files})" if self.files else "")


TIME = Quantity(
    "a time",
    ("time*", "zeit", "temps", "tiempo", "t", "seconds", "second", "sec", "s", "ms", "µs", "us", "milli*", "micro*"),
    {"s": Unit(1.0, ("s", "sec", "secs", "second", "seconds", "sekunden")),
     "ms": Unit(1e-3, ("ms", "msec", "msecs", "milli", "millis", "millisec*")),
     "us": Unit(1e-6, ("us", "µs", "μs", "usec", "usecs", "micro", "micros", "microsec*")),
     "ns": Unit(1e-9, ("ns", "nsec", "nsecs", "nano", "nanos", "nanosec*")),
     "min": Unit(60.0, ("min", "minute", "minutes", "minuten")),
     "h": Unit(3600.0, ("h", "hr", "hrs", "hour", "hours", "stunden"))},
    "the unit that the title names, else the one in which a swing lasts 0.2 to 20 s; times of day and dates count from "
    "the first", "rate= replaces it",
)
COUNT = Quantity(
    "a count of readings", ("frame", "frames", "slice", "slices", "index", "idx", "sample", "samples", "no", "nr", "n"),
    remedy="give rate=, the samples per second",
)
ANGLE = Quantity(
    "an angle",
    ("*angle*", "*winkel*", "*theta*", "*θ*", "*phi*", "*φ*", "*ϕ*", "*°*", "deg", "degree", "degrees", "rad", "radian",
     "radians"),
    {"deg": Unit(math.pi / 180.0, ("deg", "degree", "degrees", "*°")), "rad": Unit(1.0, ("rad", "radian", "radians"))},
    "fitted as it is; rows at every change of an encoder's count are read, too", "unit= gives its unit",
    "rotary sensors, encoders, Capstone, LabQuest, Arduino",
)
RATE = Quantity(
    "an angular velocity",
    ("*gyro*", "*rotation*", "wx", "wy", "wz", "*angular velocity*", "*angular speed*", "*angular rate*",
     "*winkelgeschw*", "*omega*", "*ω*", "*rad*/s*", "*deg*/s*", "*°/s*", "dps"),
    {"deg": Unit(math.pi / 180.0, ("*deg*/s*", "*°/s*", "dps")),
     "rad": Unit(1.0, ("*rad*/s*", "wx", "wy", "wz", "*gyro*"))},
    "fitted as angular velocity; the axis and the bias are found, and the sign of an absolute value",
    "columns='time=1,rate=2' chooses it", "phyphox csv, zip, xls, xlsx; Physics Toolbox, Smart Cart",
)
RATE_OF_CHANGE = Quantity(
    "a rate of change",
    ("*veloc*", "*speed*", "*accel*", "*gyro*", "*omega*", "*ω*", "wx", "wy", "wz", "*geschw*", "*dot", "*\u0307*",
     "rate", "dtheta*", "dphi*", "dθ*", "dφ*", "*rad/s*", "*deg*/s*", "*°/s*", "*m/s*", "*1/s*", "*s-1*", "*s-2*",
     "*s^-1*", "*s^-2*", "*'", "*\u2032"),
    remedy="choose it by columns='time=1,rate=2' if it is an angular velocity, or by columns='time=1,angle=2' if it is "
           "an angle",
)
FORCE = Quantity(
    "an acceleration",
    ("*accel*", "*beschleun*", *(f"{letter} {axis}" for letter in ("a", "acc", "f", "gf") for axis in "xyz"),
     "*g force*"),
    {"m/s²": Unit(1.0, tuple(f"*m{per}" for per in ("/s^2*", "/s2*", "/s²*", "/s/s*", "/s^-2*", " s^-2*", " s-2*",
                                                    " s⁻²*", "/s⁻²*"))),
     "g": Unit(STANDARD, ("(g)", "gf*", "*g force*")),
     "mg": Unit(1e-3 * STANDARD, ("(mg)", "*milli g*"))},
    "fitted as specific force, with the sensor's distance from the pivot and the tilt; without a unit, the mean "
    "decides between m/s², g, mg and, for whole numbers, counts of an MPU-6050 and its like (a power of two per g)",
    "sensor= gives the distance, columns='time=1,acceleration=2' chooses it",
    "phyphox, Physics Toolbox, MPU-6050, micro:bit in milli-g",
)
NO_FORCE = Quantity(
    "an acceleration without gravity", ("*linear*", "*without g*", "*ohne g*", "*user*", "*angular*"),
    remedy="it shows only the product of the amplitude and the distance of the phone from the pivot, a small swing far "
           "from it or a large one near it; record the acceleration with g, or the gyroscope",
)
DISTANCE = Quantity(
    "a displacement", ("*distance*", "*position*", "*displacement*", "*abstand*", "*weg*", "pos"),
    {"mm": Unit(1e-3, ("mm",)), "cm": Unit(1e-2, ("cm",)), "m": Unit(1.0, ("m",))},
    "asin(x/L), L from the period; a fit has scale and zero free", "",
    "ultrasonic sensors, one coordinate of a track",
)
TRACK = Quantity(
    "x and y of a track", ("x", "y"), DISTANCE.units,
    "the angle about the centre of the fitted circle, or about pivot=", "columns='time=1,x=2,y=3' chooses it",
    "Tracker, also its projects (.trk); ImageJ and untitled tracks on an arc",
)
GATE = Quantity(
    "a gate state", ("*state*", "*gate*", "block*"),
    reading="period, T0, length and g, from changes or from readings of the beam",
    remedy="lab-pendulum measure reads photogates; --states says what a row is",
)
PERIOD = Quantity(
    "a period", ("*period*", "schwingungsdauer*"), {"s": TIME.units["s"]},
    "T0 by the decay of the periods, or by the amplitudes beside them",
    "lab-pendulum measure reads periods of one pendulum, one per line or beside their amplitudes",
    "photogates, stopwatches",
)
AMPLITUDE = Quantity(
    "an amplitude", ("*amplitud*", *ANGLE.words), ANGLE.units,
    "beside times by lab-pendulum measure --amplitudes; beside periods by lab-pendulum measure",
)
LENGTH = Quantity(
    "a length", ("*length*", "*länge*", "*laenge*", "l"), DISTANCE.units,
    "g from T² against the length, beside a period or the time of several",
    "lab-pendulum measure reads lengths beside periods", "ruler and stopwatch",
)
ERROR = Quantity(
    "an error", ("*error*", "*uncert*", "*fehler*", "*unsicher*", "*±*", "*+-*", "*sigma*"),
    reading="the error of the column before it, in tables by hand",
)
CORRELATION = Quantity(
    "a result calculated from a swing",
    ("*correlation*", "*korrelation*", "time shift*", "*frequenc*", "*frequenz*", "*spectr*", "*spektr*", "fft*"),
    remedy="export the readings of the sensor; in an archive or a workbook, part= names their table",
)
COUNTS = Quantity(
    "a count of an encoder", ("count", "counts", "ticks", "pulses"),
    remedy="give the size of one count, as scale=360/4096, unit=deg for 4096 counts a turn",
)
RAW = Quantity(
    "a count of a converter", ("raw", "*raw", "adc*", "lsb", *(f"*{bits} bit*" for bits in (10, 12, 14, 16))),
    remedy="give the size of one count: scale=360/4096, unit=deg for a magnetic encoder of 12 bits a turn (360/16384 "
           "for 14 bits, 360/65536 for 16), scale=270/4095, unit=deg for a potentiometer of 270 degrees at 12 bits; "
           "the name AS5600, AS5048 or AS5047 above the readings gives it, too",
    files="Arduino and its like",
)
TURNS = {"AS5600": 4096, "AS5048": 16384, "AS5047": 16384}
"""Name of a magnetic encoder in a title or a header -> its counts in a turn."""
GYROSCOPE = Quantity(
    "an angular velocity in counts", (),
    remedy="give the size of one count, as scale=1/131, unit=deg for an MPU6050 that measures up to 250 degrees per "
           "second (1/65.5 up to 500, 1/32.8 up to 1000, 1/16.4 up to 2000); a header such as MPU6050 ±250 °/s gives "
           "it, too", files="MPU-6050, MPU-6500, MPU-9250, ICM-20948",
)
RANGES = {250: 131.0, 500: 65.5, 1000: 32.8, 2000: 16.4}
"""Range of these gyroscopes [deg/s] -> counts per deg/s (MPU-6050, InvenSense PS-MPU-6000A-00, section 6.1)."""
PER_G = tuple(2**bits for bits in range(8, 15))
"""Counts per g of accelerometers: 16384 of an MPU-6050 at ±2 g, half of it at ±4 g, and so on."""
OTHER_ANGLE = Quantity(
    "an angle in another unit",
    ("mrad", "milliradian*", "gon", "rev", "revolution*", "turn", "turns", "arcmin", "arcsec"),
    remedy="give the size of the unit, as scale=0.001, unit=rad for mrad, or scale=360, unit=deg for turns",
)
OTHER = Quantity(
    "another quantity",
    ("*counter*", "*energy*", "*voltage*", "*force*", "*temp*", "*humid*", "*press*", "*battery*", "*mass*",
     "*marker*", "ke", "pe", "te"),
    remedy="choose another column",
)
OTHER_UNIT = Quantity(
    "a quantity in another unit",
    ("volt", "volts", *(f"({unit})" for unit in ("V", "mV", "m", "cm", "mm", "px", "pixel", "pixels", "N", "A", "g",
                                                 "%"))),
    remedy="if it is proportional to the angle, give its size, as scale=30, unit=deg for 30 degrees per volt",
)

_DRIVEN = "motor, friction, delay and sensor, with the angle beside it, by lab-pendulum fit"
TORQUE = Quantity(
    "a torque", ("*torque*", "tau", "*drehmoment*", "*couple", "*moment"),
    {"N m": Unit(1.0, ("nm",)), "mN m": Unit(1e-3, ("mnm", "nmm")), "N cm": Unit(1e-2, ("ncm",)),
     "µN m": Unit(1e-6, ("µnm", "unm"))}, _DRIVEN, "--torque chooses it",
)
CURRENT = Quantity(
    "a motor's current", ("*current*", "iq", "amp", "amps", "*strom"),
    {"A": Unit(1.0, ("a",)), "mA": Unit(1e-3, ("ma",))}, _DRIVEN, "--current chooses it",
)
ACTION = Quantity(
    "an action", ("action", "control", "command", "duty", "pwm", "u", "*stellgr*"),
    {"1": Unit(1.0, ("1", "", "-")), "%": Unit(0.01, ("%", "percent"))}, _DRIVEN, "--action chooses it",
)

QUANTITIES: Sequence[Quantity] = (
    TIME, COUNT, ANGLE, RATE, FORCE, DISTANCE, TRACK, GATE, PERIOD, AMPLITUDE, LENGTH, ERROR, TORQUE, CURRENT, ACTION,
    NO_FORCE, RATE_OF_CHANGE, CORRELATION, COUNTS, RAW, GYROSCOPE, OTHER_ANGLE, OTHER_UNIT, OTHER,
)
"""All quantities, in the order of the table of formats."""
