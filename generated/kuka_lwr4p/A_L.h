/* kuka_lwr4p, model A, payload L: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: 84f86672d60ad720c14134d57c20fb58e17aabe0d8e019395b8155aea5918b29
   generator 1, CasADi 3.8.2, SymPy 1.14.0
   given cos and sin, inertial entries of W: 455 additions, 621 multiplications;
   torque, with friction: 309 additions, 302 multiplications
*/

#ifndef KUKA_LWR4P_A_L_H
#define KUKA_LWR4P_A_L_H

#define KUKA_LWR4P_A_L_JOINTS 7
#define KUKA_LWR4P_A_L_CHANNELS 7
#define KUKA_LWR4P_A_L_PARAMETERS 79

/* q in rad (m), dq in rad/s, ddq in rad/s^2. W: 7 x 79, row after row; tau in N m (N).
   Rows: tau_m1, tau_m2, tau_m3, tau_m4, tau_m5, tau_m6, tau_m7.
   Parameters chi:
     0 ZZ1R = ZZ1 + Iam1 + YY2
     1 XX2R = XX2 - YY2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)
     2 XY2
     3 XZ2
     4 YZ2
     5 ZZ2R = ZZ2 + Iam2 + YY3 + 2*rl3*MZ3 + rl3**2*(M3 + M4 + M5 + M6 + M7)
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
    43 Fvm1R = Fvm1 + Fvl1
    44 Fcm1R = Fcm1 + Fcl1
    45 Offm1R = Offm1 + Offl1
    46 Fvm2R = Fvm2 + Fvl2
    47 Fcm2R = Fcm2 + Fcl2
    48 Offm2R = Offm2 + Offl2
    49 Iam3
    50 Fvm3R = Fvm3 + Fvl3
    51 Fcm3R = Fcm3 + Fcl3
    52 Offm3R = Offm3 + Offl3
    53 Iam4
    54 Fvm4R = Fvm4 + Fvl4
    55 Fcm4R = Fcm4 + Fcl4
    56 Offm4R = Offm4 + Offl4
    57 Iam5
    58 Fvm5R = Fvm5 + Fvl5
    59 Fcm5R = Fcm5 + Fcl5
    60 Offm5R = Offm5 + Offl5
    61 Iam6
    62 Fvm6R = Fvm6 + Fvl6
    63 Fcm6R = Fcm6 + Fcl6
    64 Offm6R = Offm6 + Offl6
    65 Iam7
    66 Fvm7R = Fvm7 + Fvl7
    67 Fcm7R = Fcm7 + Fcl7
    68 Offm7R = Offm7 + Offl7
    69 XXL
    70 XYL
    71 XZL
    72 YYL
    73 YZL
    74 ZZL
    75 MXL
    76 MYL
    77 MZL
    78 ML
*/
#ifdef __cplusplus
extern "C" {
#endif
void kuka_lwr4p_A_L_regressor(const double q[7], const double dq[7], const double ddq[7], double W[553]);
void kuka_lwr4p_A_L_torque(const double q[7], const double dq[7], const double ddq[7], const double chi[79], double tau[7]);
#ifdef __cplusplus
}
#endif

#endif
