"""Tests of air, water and glycerol against published tables, and of media by name."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pendulum_env import SceneError
from pendulum_env.physics.medium import MEDIA, Medium, air, glycerol, medium_from, water

# temperature [°C] -> viscosity [mPa s] of water: CRC Handbook of Chemistry and Physics
WATER = ((0.0, 1.793), (10.0, 1.307), (20.0, 1.002), (40.0, 0.653), (60.0, 0.467), (80.0, 0.354), (100.0, 0.282))
# temperature [°C] -> density [kg/m³] of water: CRC Handbook of Chemistry and Physics
WATER_DENSITY = ((0.0, 999.84), (10.0, 999.70), (20.0, 998.21), (40.0, 992.22), (60.0, 983.20), (80.0, 971.82))
# temperature [K] -> viscosity [µPa s] of air at low pressure: CRC Handbook of Chemistry and Physics
AIR = ((200.0, 13.3), (300.0, 18.5), (400.0, 23.1), (500.0, 27.1), (600.0, 30.8))
# temperature [°C] -> viscosity [mPa s] of glycerol: Segur & Oberstar 1951, Ind. Eng. Chem. 43, 2117
GLYCEROL = ((0.0, 12070.0), (10.0, 3900.0), (20.0, 1410.0), (30.0, 612.0), (40.0, 284.0), (50.0, 142.0), (60.0, 81.3),
            (80.0, 31.9), (100.0, 14.8))
# temperature [°C] -> density [kg/m³] of glycerol: Bosart & Snoddy 1928, Ind. Eng. Chem. 20, 1377, and Glycerine
# Producers' Association 1963, Physical Properties of Glycerine and Its Solutions
GLYCEROL_DENSITY = ((0.0, 1272.7), (20.0, 1261.3), (40.0, 1249.0), (75.5, 1225.6), (99.5, 1209.7))


def test_media_have_the_published_viscosity_and_density() -> None:
    """The formulas are accurate to 0.1 kg/m³, to 2.5 % for the viscosity of water and air, and to 6 % for glycerol's.
    """
    for celsius, wanted in WATER:
        assert water(celsius).viscosity == pytest.approx(1e-3 * wanted, rel=0.025)
    for celsius, wanted in WATER_DENSITY:
        assert water(celsius).density == pytest.approx(wanted, abs=0.11)
    for kelvin, wanted in AIR:
        assert air(kelvin - 273.15).viscosity == pytest.approx(1e-6 * wanted, rel=0.025)
    for celsius, wanted in GLYCEROL:
        assert glycerol(celsius).viscosity == pytest.approx(1e-3 * wanted, rel=0.06)
    assert glycerol(20.0).viscosity == pytest.approx(1.412, rel=2e-3)  # CRC Handbook
    for celsius, wanted in GLYCEROL_DENSITY:
        assert glycerol(celsius).density == pytest.approx(wanted, rel=4e-3)
    assert air(20.0).kinematic_viscosity == pytest.approx(1.51e-5, rel=5e-3)
    assert math.isnan(Medium().kinematic_viscosity)


def test_media_by_name() -> None:
    for name, make in MEDIA.items():
        assert medium_from({"name": name}) == make()
        assert make().name == name
    assert medium_from({"name": "water", "temperature": 40.0}) == water(40.0)
    assert medium_from({"name": "air", "temperature": 0.0, "pressure": 5e4}) == air(0.0, 5e4)
    assert medium_from({"name": "oil", "density": 900.0, "viscosity": 0.1}) == Medium("oil", 900.0, 0.1)
    assert medium_from({"name": "air", "density": 1.2}) == Medium("air", 1.2)
    assert medium_from({}) == Medium()


REFUSED: dict[str, tuple[Any, str]] = {
    "hot water": (lambda: water(101.0), "temperature must be from 0 to 100 degrees Celsius, not 101."),
    "ice": (lambda: water(-0.1), "temperature must be from 0 to 100"),
    "hot glycerol": (lambda: glycerol(150.0), "temperature must be from 0 to 100"),
    "liquid air": (lambda: air(-200.0), "temperature must be from -100 to 1600"),
    "medium": (lambda: medium_from({"name": "watr"}), "no medium 'watr' without density and viscosity; did you mean"),
    "medium's value": (lambda: medium_from({"name": "water", "temprature": 1.0}), "did you mean temperature?"),
    "vacuum's value": (lambda: medium_from({"name": "vacuum", "temperature": 1.0}), "no value 'temperature'"),
    "custom medium's value": (lambda: medium_from({"viskosity": 1.0}), "did you mean viscosity or density?"),
    "medium is none": (lambda: medium_from(5), "must be given by a dict"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_clear_sentence(case: str) -> None:
    make, words = REFUSED[case]
    with pytest.raises(SceneError) as error:
        make()
    assert words in str(error.value)
    assert "\n" not in str(error.value)
