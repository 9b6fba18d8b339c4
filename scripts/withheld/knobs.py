"""Every knob of the physics by name, and the value at which it does nothing.

Knobs that only shape an effect (times, exponents, frequencies) have a usual value instead: alone they do nothing.
"""

from __future__ import annotations

NEUTRAL: dict[str, float] = dict.fromkeys(
    """sigma_c tau_d T_f m_b c_2 c_f F_d d_2 k_c c_P k_a alpha_0 F_off g_F e_alpha e_mu e_y e_v kappa_s kappa_z A_wc
    A_ws m_dc m_ds k_t w_t b_0 b_g q_rig A_gear A_hum g_knee b_dead g_rate a_second A_ring A_half k_bump e_cyclic h_heat
    L_patch T_second a_stribeck""".split(),
    0.0,
)

SHAPE: dict[str, float] = {
    "tau_2": 0.05,
    "a_f": 0.25,
    "delta_d": 2e-3,
    "y_P": 3e-3,
    "tau_t": 3.0,
    "f_rig": 6.0,
    "z_rig": 0.03,
    "f_gear": 7.3,
    "f_hum": 62.0,
    "f_ring": 17.0,
    "phase": 0.0,
    "tau_heat": 1.5,
    "v_stribeck": 0.05,
}

DEFAULT = NEUTRAL | SHAPE

#: act behind the tyre: tests that differ in these alone share one integration
BEHIND = frozenset(
    """tau_d T_f m_b F_off g_F A_wc A_ws k_t w_t q_rig A_gear A_hum g_knee b_dead g_rate A_ring A_half T_second tau_t
    f_rig z_rig f_gear f_hum f_ring""".split()
)
