"""Proton density, relaxation times and share of fat of tissues at 1.5 T and 3 T.

Sources of T1 and T2:

- muscle, cartilage, synovial fluid, subcutaneous fat, marrow: Gold 2004, volunteers' knees, 1.5 and 3 T;
- blood, nerve (the optic one): Stanisz 2005, excised tissue at 37 degrees C, 1.5 and 3 T;
- cortical bone: T1 of Reichert 2005 (the lower end, 1.5 T) and Du 2010 (3 T); T2 of Du 2013;
- tendon: T1 at 3 T between Filho 2009 (specimens) and Wright 2012 (volunteers, 725 ms); T2 of Robson 2006;
- ligament, fascia: T2 within Robson 2006's 4 to 10 ms; T1 assumed between tendon's and cartilage's;
- dermis: Richard 1991, 1.5 T; its T1 at 3 T is scaled as muscle's.

Solids (cortical bone, tendon, ligament) hardly show at these echo times: their T1 does not matter. Proton
density is relative to pure water: a tissue's water by volume; fat's is near water's. Shares of fat are usual
proton density fat fractions, not of one source: subcutaneous fat, yellow marrow, a young hand's muscle.

T2* is not a constant of a tissue: it depends on voxels and on shim. Those of muscle, fat and marrow were
chosen so that tissue ratios at three echo times agree with the 3 T gradient echoes of a foot, a hand and
calves (`benchmarks.images.calibration`); at 1.5 T the field-dependent rate 1/T2* - 1/T2 is half of that.
Trabecular bone shortens T2* of the marrow around it (Majumdar 1991), most near joints.

References
----------
Gold 2004, AJR 183:343. Stanisz 2005, Magn Reson Med 54:507. Reichert 2005, Magn Reson Imaging 23:611.
Du 2010, J Magn Reson 207:304. Du 2013, NMR Biomed 26:489. Robson 2006, NMR Biomed 19:765.
Filho 2009, AJR 192:W117. Wright 2012, Magn Reson Med 68:1279. Richard 1991, J Invest Dermatol 97:120.
Majumdar 1991, Magn Reson Med 22:111.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Times:
    """T1, T2 and T2* in ms."""

    t1: float
    t2: float
    t2_star: float


@dataclass(frozen=True)
class TissueSignal:
    """Proton density relative to water, share of it that is fat, and times at 1.5 T and 3 T.

    fat: share of the proton density that is fat; water and fat of a tissue share its times.
    """

    density: float
    fat: float
    low: Times
    high: Times

    def at(self, field: float) -> Times:
        """Times at 1.5 T or 3 T."""
        return self.high if field > 2.0 else self.low


def _tissue(
    density: float, fat: float, low: tuple[float, float], high: tuple[float, float], star: float
) -> TissueSignal:
    """A tissue by (T1, T2) at 1.5 T and 3 T, and T2* at 3 T."""
    dephasing = 0.5 * (1.0 / star - 1.0 / high[1])
    return TissueSignal(
        density, fat, Times(*low, 1.0 / (1.0 / low[1] + max(dephasing, 0.0))), Times(*high, star)
    )


TISSUES = {
    "fat": _tissue(0.95, 0.87, (288, 165), (371, 133), 20.0),
    "marrow": _tissue(0.90, 0.92, (288, 165), (365, 133), 20.0),
    # Marrow among trabeculae: shorter T2*, and bone in place of some of it.
    "trabeculae": _tissue(0.72, 0.92, (288, 120), (365, 100), 8.0),
    "muscle": _tissue(0.80, 0.02, (1130, 35), (1420, 32), 24.0),
    "cartilage": _tissue(0.75, 0.0, (1060, 42), (1240, 37), 20.0),
    "fluid": _tissue(0.98, 0.0, (2850, 1210), (3620, 767), 100.0),
    "cortical": _tissue(0.20, 0.0, (140, 0.6), (223, 0.5), 0.4),
    "tendon": _tissue(0.65, 0.0, (400, 1.8), (600, 1.5), 1.2),
    "ligament": _tissue(0.65, 0.0, (450, 7.0), (650, 6.0), 4.0),
    "fascia": _tissue(0.65, 0.0, (450, 7.0), (650, 6.0), 4.0),
    "dermis": _tissue(0.70, 0.05, (870, 26), (1090, 24), 10.0),
    "nerve": _tissue(0.75, 0.15, (815, 77), (1083, 78), 30.0),
    "blood": _tissue(0.90, 0.0, (1441, 290), (1932, 275), 50.0),
    "flow void": _tissue(0.0, 0.0, (1441, 290), (1932, 275), 50.0),
    "air": _tissue(0.0, 0.0, (1000, 100), (1000, 100), 50.0),
}
