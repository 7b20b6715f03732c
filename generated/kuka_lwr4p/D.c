/* kuka_lwr4p, model D: regressor and torque.
   Written by regenerate-model; do not edit.

   robot file sha256: 84f86672d60ad720c14134d57c20fb58e17aabe0d8e019395b8155aea5918b29
   generator 1, CasADi 3.8.2, SymPy 1.14.0
   given cos and sin, inertial entries of W: 0 additions, 0 multiplications;
   torque, with friction: 21 additions, 21 multiplications
*/

#include <math.h>

#ifndef REAL /* plain numbers; for vectors these come from outside */
#define REAL double
#define CONSTANT(x) (x)
#define OUTPUT double *
#define STORE(W, k, x) ((W)[k] = (x))
#define CALL_exp(x) exp(x)
#define CALL_sin(x) sin(x)
#define CALL_cos(x) cos(x)
#define CALL_tanh(x) tanh(x)
#define CALL_abs(x) fabs(x)
#define CALL_sqrt(x) sqrt(x)
#define CALL_sign(x) ((double)(((x) > 0) - ((x) < 0)))
#define CALL_pow(x, y) pow(x, y)
#define PLAIN
#endif

/* The entries of W that differ from each other; c = cos q, s = sin q, sign = sign(dq). */
static inline void kuka_lwr4p_D_columns(const REAL *c, const REAL *s, const REAL *q, const REAL *dq, const REAL *ddq, const REAL *sign,
    const REAL *extra, OUTPUT W)
{

  (void)c; (void)s; (void)q; (void)dq; (void)ddq; (void)sign; (void)extra; (void)W;
}

/* One torque per channel; chi as in the header's list. */
static inline void kuka_lwr4p_D_inverse_dynamics(const REAL *c, const REAL *s, const REAL *q, const REAL *dq, const REAL *ddq, const REAL *sign,
    const REAL *extra, const double *chi, OUTPUT tau)
{
  REAL a0, a1, a2;
  a0 = CONSTANT(chi[0]);
  a1 = ddq[0];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[1]);
  a2 = dq[0];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[2]);
  a2 = sign[0];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[3]);
  a0 = (a0+a1);
  STORE(tau, 0, a0);
  a0 = CONSTANT(chi[4]);
  a1 = ddq[1];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[5]);
  a2 = dq[1];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[6]);
  a2 = sign[1];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[7]);
  a0 = (a0+a1);
  STORE(tau, 1, a0);
  a0 = CONSTANT(chi[8]);
  a1 = ddq[2];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[9]);
  a2 = dq[2];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[10]);
  a2 = sign[2];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[11]);
  a0 = (a0+a1);
  STORE(tau, 2, a0);
  a0 = CONSTANT(chi[12]);
  a1 = ddq[3];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[13]);
  a2 = dq[3];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[14]);
  a2 = sign[3];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[15]);
  a0 = (a0+a1);
  STORE(tau, 3, a0);
  a0 = CONSTANT(chi[16]);
  a1 = ddq[4];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[17]);
  a2 = dq[4];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[18]);
  a2 = sign[4];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[19]);
  a0 = (a0+a1);
  STORE(tau, 4, a0);
  a0 = CONSTANT(chi[20]);
  a1 = ddq[5];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[21]);
  a2 = dq[5];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[22]);
  a2 = sign[5];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[23]);
  a0 = (a0+a1);
  STORE(tau, 5, a0);
  a0 = CONSTANT(chi[24]);
  a1 = ddq[6];
  a0 = (a0*a1);
  a1 = CONSTANT(chi[25]);
  a2 = dq[6];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[26]);
  a2 = sign[6];
  a1 = (a1*a2);
  a0 = (a0+a1);
  a1 = CONSTANT(chi[27]);
  a0 = (a0+a1);
  STORE(tau, 6, a0);
  (void)c; (void)s; (void)q; (void)dq; (void)ddq; (void)sign; (void)extra; (void)tau; (void)chi;
}

#ifdef PLAIN
#include <string.h>
#include "D.h"

void kuka_lwr4p_D_regressor(const double q[7], const double dq[7], const double ddq[7], double W[196])
{
  double c[7], s[7], sign[7], entry[1];
  c[0] = cos(q[0]); s[0] = sin(q[0]); sign[0] = CALL_sign(dq[0]);
  c[1] = cos(q[1]); s[1] = sin(q[1]); sign[1] = CALL_sign(dq[1]);
  c[2] = cos(q[2]); s[2] = sin(q[2]); sign[2] = CALL_sign(dq[2]);
  c[3] = cos(q[3]); s[3] = sin(q[3]); sign[3] = CALL_sign(dq[3]);
  c[4] = cos(q[4]); s[4] = sin(q[4]); sign[4] = CALL_sign(dq[4]);
  c[5] = cos(q[5]); s[5] = sin(q[5]); sign[5] = CALL_sign(dq[5]);
  c[6] = cos(q[6]); s[6] = sin(q[6]); sign[6] = CALL_sign(dq[6]);
  kuka_lwr4p_D_columns(c, s, q, dq, ddq, sign, 0, entry);
  memset(W, 0, 196 * sizeof(double));
  W[0] = ddq[0];
  W[1] = dq[0];
  W[2] = sign[0];
  W[3] = 1;
  W[32] = ddq[1];
  W[33] = dq[1];
  W[34] = sign[1];
  W[35] = 1;
  W[64] = ddq[2];
  W[65] = dq[2];
  W[66] = sign[2];
  W[67] = 1;
  W[96] = ddq[3];
  W[97] = dq[3];
  W[98] = sign[3];
  W[99] = 1;
  W[128] = ddq[4];
  W[129] = dq[4];
  W[130] = sign[4];
  W[131] = 1;
  W[160] = ddq[5];
  W[161] = dq[5];
  W[162] = sign[5];
  W[163] = 1;
  W[192] = ddq[6];
  W[193] = dq[6];
  W[194] = sign[6];
  W[195] = 1;
  (void)entry;
}

void kuka_lwr4p_D_torque(const double q[7], const double dq[7], const double ddq[7], const double chi[28], double tau[7])
{
  double c[7], s[7], sign[7];
  c[0] = cos(q[0]); s[0] = sin(q[0]); sign[0] = CALL_sign(dq[0]);
  c[1] = cos(q[1]); s[1] = sin(q[1]); sign[1] = CALL_sign(dq[1]);
  c[2] = cos(q[2]); s[2] = sin(q[2]); sign[2] = CALL_sign(dq[2]);
  c[3] = cos(q[3]); s[3] = sin(q[3]); sign[3] = CALL_sign(dq[3]);
  c[4] = cos(q[4]); s[4] = sin(q[4]); sign[4] = CALL_sign(dq[4]);
  c[5] = cos(q[5]); s[5] = sin(q[5]); sign[5] = CALL_sign(dq[5]);
  c[6] = cos(q[6]); s[6] = sin(q[6]); sign[6] = CALL_sign(dq[6]);
  kuka_lwr4p_D_inverse_dynamics(c, s, q, dq, ddq, sign, 0, chi, tau);
}

#undef REAL
#undef CONSTANT
#undef OUTPUT
#undef STORE
#undef CALL_exp
#undef CALL_sin
#undef CALL_cos
#undef CALL_tanh
#undef CALL_abs
#undef CALL_sqrt
#undef CALL_sign
#undef CALL_pow
#undef PLAIN
#endif
