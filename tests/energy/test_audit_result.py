"""Words and tables of an audit."""

import numpy as np

from mi_lcair.energy.audit_result import Audit, FluxAndError

FLUX = {"incident": FluxAndError(50.0, 2.0), "absorbed": FluxAndError(30.0, 1.0)}
AUDIT = Audit(
    scene_name="room",
    band="LWIR",
    total={"emitted": FluxAndError(100.0, 1.0), "balance": FluxAndError(0.5, 0.2)},
    materials={"paint": FLUX},
    shares={
        "scene": {"emitted": FluxAndError(1.0, 0.0), "balance": FluxAndError(0.005, 0.002)},
        "paint": {"incident": FluxAndError(1.0, 0.0), "absorbed": FluxAndError(0.6, 0.01)},
    },
    remarks=[],
    photons=1000,
)


def test_summary():
    assert AUDIT.summary() == (
        "audit of room, LWIR: 100 +- 1 W emitted, balance 0.5 +- 0.2 % of it (standard errors), "
        "no remarks"
    )


def test_entries_and_rows():
    entries = AUDIT.as_dict()
    assert entries["total_W"]["balance"] == {"value": 0.5, "standard_error": 0.2}
    assert entries["materials_W"]["paint"]["absorbed"] == {"value": 30.0, "standard_error": 1.0}
    assert entries["shares"]["paint"]["absorbed"] == {"value": 0.6, "standard_error": 0.01}
    assert all(len(column) == 4 for column in AUDIT.columns().values())
    assert np.isfinite(
        np.concatenate([c for c in AUDIT.columns().values() if c.dtype == float])
    ).all()
