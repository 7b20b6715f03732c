/* kuka_lwr4p, model C, payload L: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: 84f86672d60ad720c14134d57c20fb58e17aabe0d8e019395b8155aea5918b29
   generator 1, CasADi 3.8.2, SymPy 1.14.0
   given cos and sin, inertial entries of W: 455 additions, 621 multiplications;
   torque, with friction: 332 additions, 318 multiplications
*/

#ifndef KUKA_LWR4P_C_L_H
#define KUKA_LWR4P_C_L_H

#define KUKA_LWR4P_C_L_JOINTS 7
#define KUKA_LWR4P_C_L_CHANNELS 14
#define KUKA_LWR4P_C_L_PARAMETERS 102

/* q in rad (m), dq in rad/s, ddq in rad/s^2. W: 14 x 102, row after row; tau in N m (N).
   Rows: tau_m1, tau_m2, tau_m3, tau_m4, tau_m5, tau_m6, tau_m7, tau_l1, tau_l2, tau_l3, tau_l4, tau_l5, tau_l6, tau_l7.
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
    43 Iam1
    44 Fvm1
    45 Fcm1
    46 Offm1
    47 Fvl1
    48 Fcl1
    49 Offl1
    50 Iam2
    51 Fvm2
    52 Fcm2
    53 Offm2
    54 Fvl2
    55 Fcl2
    56 Offl2
    57 Iam3
    58 Fvm3
    59 Fcm3
    60 Offm3
    61 Fvl3
    62 Fcl3
    63 Offl3
    64 Iam4
    65 Fvm4
    66 Fcm4
    67 Offm4
    68 Fvl4
    69 Fcl4
    70 Offl4
    71 Iam5
    72 Fvm5
    73 Fcm5
    74 Offm5
    75 Fvl5
    76 Fcl5
    77 Offl5
    78 Iam6
    79 Fvm6
    80 Fcm6
    81 Offm6
    82 Fvl6
    83 Fcl6
    84 Offl6
    85 Iam7
    86 Fvm7
    87 Fcm7
    88 Offm7
    89 Fvl7
    90 Fcl7
    91 Offl7
    92 XXL
    93 XYL
    94 XZL
    95 YYL
    96 YZL
    97 ZZL
    98 MXL
    99 MYL
   100 MZL
   101 ML
*/
#ifdef __cplusplus
extern "C" {
#endif
void kuka_lwr4p_C_L_regressor(const double q[7], const double dq[7], const double ddq[7], double W[1428]);
void kuka_lwr4p_C_L_torque(const double q[7], const double dq[7], const double ddq[7], const double chi[102], double tau[14]);
#ifdef __cplusplus
}
#endif

#endif
