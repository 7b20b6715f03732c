/* Torque that holds the LWR still, from base parameters, with the generated C alone:
   cc -std=c99 -O2 -Ikuka_lwr4p example.c kuka_lwr4p/A.c -lm -o example && ./example */
#include <stdio.h>
#include "A.h"

int main(void)
{
    double q[7] = {0.3, 0.6, -0.2, 1.1, 0.4, -0.5, 0.1}, dq[7] = {0}, ddq[7] = {0};
    double chi[KUKA_LWR4P_A_PARAMETERS] = {0}, tau[7], W[7 * KUKA_LWR4P_A_PARAMETERS];
    chi[7] = 3.45;   /* MY2R, see the list in A.h */
    chi[21] = -1.35; /* MY4R */
    kuka_lwr4p_A_torque(q, dq, ddq, chi, tau);
    kuka_lwr4p_A_regressor(q, dq, ddq, W);
    for (int i = 0; i < 7; ++i) {
        double from_W = 0;
        for (int k = 0; k < KUKA_LWR4P_A_PARAMETERS; ++k) from_W += W[i * KUKA_LWR4P_A_PARAMETERS + k] * chi[k];
        printf("tau_m%d = %.12g N m, by the regressor %.12g N m\n", i + 1, tau[i], from_W);
    }
    return 0;
}
