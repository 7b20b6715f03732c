/* kuka_lwr4p, model D: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: 84f86672d60ad720c14134d57c20fb58e17aabe0d8e019395b8155aea5918b29
   generator 1, CasADi 3.8.2, SymPy 1.14.0
   given cos and sin, inertial entries of W: 0 additions, 0 multiplications;
   torque, with friction: 21 additions, 21 multiplications
*/

#ifndef KUKA_LWR4P_D_H
#define KUKA_LWR4P_D_H

#define KUKA_LWR4P_D_JOINTS 7
#define KUKA_LWR4P_D_CHANNELS 7
#define KUKA_LWR4P_D_PARAMETERS 28

/* q in rad (m), dq in rad/s, ddq in rad/s^2. W: 7 x 28, row after row; tau in N m (N).
   Rows: tau_d1, tau_d2, tau_d3, tau_d4, tau_d5, tau_d6, tau_d7.
   Parameters chi:
     0 Iam1
     1 Fvm1
     2 Fcm1
     3 Offm1
     4 Iam2
     5 Fvm2
     6 Fcm2
     7 Offm2
     8 Iam3
     9 Fvm3
    10 Fcm3
    11 Offm3
    12 Iam4
    13 Fvm4
    14 Fcm4
    15 Offm4
    16 Iam5
    17 Fvm5
    18 Fcm5
    19 Offm5
    20 Iam6
    21 Fvm6
    22 Fcm6
    23 Offm6
    24 Iam7
    25 Fvm7
    26 Fcm7
    27 Offm7
*/
#ifdef __cplusplus
extern "C" {
#endif
void kuka_lwr4p_D_regressor(const double q[7], const double dq[7], const double ddq[7], double W[196]);
void kuka_lwr4p_D_torque(const double q[7], const double dq[7], const double ddq[7], const double chi[28], double tau[7]);
#ifdef __cplusplus
}
#endif

#endif
