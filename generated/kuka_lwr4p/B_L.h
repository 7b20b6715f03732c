/* kuka_lwr4p, model B, payload L: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: 84f86672d60ad720c14134d57c20fb58e17aabe0d8e019395b8155aea5918b29
   generator 1, CasADi 3.8.2, SymPy 1.14.0
   given cos and sin, inertial entries of W: 455 additions, 621 multiplications;
   torque, with friction: 304 additions, 297 multiplications
*/

#ifndef KUKA_LWR4P_B_L_H
#define KUKA_LWR4P_B_L_H

#define KUKA_LWR4P_B_L_JOINTS 7
#define KUKA_LWR4P_B_L_CHANNELS 7
#define KUKA_LWR4P_B_L_PARAMETERS 74

/* q in rad (m), dq in rad/s, ddq in rad/s^2. W: 7 x 74, row after row; tau in N m (N).
   Rows: tau_l1, tau_l2, tau_l3, tau_l4, tau_l5, tau_l6, tau_l7.
   Parameters chi:
     0 ZZ1R = ZZ1 + YY2
     1 XX2R = XX2 - YY2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)
     2 XY2
     3 XZ2
     4 YZ2
     5 ZZ2R = ZZ2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)
     6 MX2
     7 MY2R = MY2 + MZ3 + rl3*(M3 + M4 + M5 + M6 + M7)
     8 XX3R = XX3 - YY3 + YY4
     9 XY3
    10 XZ3
    11 YZ3
    12 ZZ3R = ZZ3 + YY4
    13 MX3
    14 MY3R = MY3 + MZ4
    15 XX4R = XX4 - YY4 + YY5 + 2*rl5*MZ5 + rl5**2*(M5 + M6 + M7)
    16 XY4
    17 XZ4
    18 YZ4
    19 ZZ4R = ZZ4 + YY5 + 2*rl5*MZ5 + rl5**2*(M5 + M6 + M7)
    20 MX4
    21 MY4R = MY4 - MZ5 - rl5*(M5 + M6 + M7)
    22 XX5R = XX5 - YY5 + YY6
    23 XY5
    24 XZ5
    25 YZ5
    26 ZZ5R = ZZ5 + YY6
    27 MX5
    28 MY5R = MY5 - MZ6
    29 XX6R = XX6 - YY6 + YY7
    30 XY6
    31 XZ6
    32 YZ6
    33 ZZ6R = ZZ6 + YY7
    34 MX6
    35 MY6R = MY6 + MZ7
    36 XX7R = XX7 - YY7
    37 XY7
    38 XZ7
    39 YZ7
    40 ZZ7
    41 MX7
    42 MY7
    43 Fvl1
    44 Fcl1
    45 Offl1
    46 Fvl2
    47 Fcl2
    48 Offl2
    49 Fvl3
    50 Fcl3
    51 Offl3
    52 Fvl4
    53 Fcl4
    54 Offl4
    55 Fvl5
    56 Fcl5
    57 Offl5
    58 Fvl6
    59 Fcl6
    60 Offl6
    61 Fvl7
    62 Fcl7
    63 Offl7
    64 XXL
    65 XYL
    66 XZL
    67 YYL
    68 YZL
    69 ZZL
    70 MXL
    71 MYL
    72 MZL
    73 ML
*/
#ifdef __cplusplus
extern "C" {
#endif
void kuka_lwr4p_B_L_regressor(const double q[7], const double dq[7], const double ddq[7], double W[518]);
void kuka_lwr4p_B_L_torque(const double q[7], const double dq[7], const double ddq[7], const double chi[74], double tau[7]);
#ifdef __cplusplus
}
#endif

#endif
