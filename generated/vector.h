/* What a model's C needs to run on vectors: one lane is one sample. GCC or Clang (vector extensions). */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif

typedef double vector __attribute__((vector_size(8 * LANES)));
typedef int64_t integers __attribute__((vector_size(8 * LANES)));
typedef double loose_vector __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

/* Entry k of the group's samples goes to row[k][i], row[k][i + 1], ... */
typedef struct { double *const *row; ptrdiff_t i; } entries;

static inline vector broadcast(double x)
{
    vector v;
    for (int l = 0; l < LANES; ++l) v[l] = x;
    return v;
}

#define LANE_BY_LANE(name, value)                                                                               \
    static inline vector name(vector x)                                                                         \
    {                                                                                                           \
        for (int l = 0; l < LANES; ++l) x[l] = value;                                                           \
        return x;                                                                                               \
    }
LANE_BY_LANE(vector_exp, exp(x[l]))
LANE_BY_LANE(vector_sin, sin(x[l]))
LANE_BY_LANE(vector_cos, cos(x[l]))
LANE_BY_LANE(vector_tanh, tanh(x[l]))
LANE_BY_LANE(vector_abs, fabs(x[l]))
LANE_BY_LANE(vector_sqrt, sqrt(x[l]))
LANE_BY_LANE(vector_sign, x[l] > 0 ? 1.0 : x[l] < 0 ? -1.0 : x[l])
static inline vector vector_pow(vector x, vector y)
{
    for (int l = 0; l < LANES; ++l) x[l] = pow(x[l], y[l]);
    return x;
}

#define REAL vector
#define CONSTANT(x) broadcast(x)
#define OUTPUT entries
#define STORE(W, k, x) (*(loose_vector *)((W).row[k] + (W).i) = (x))
#define CALL_exp(x) vector_exp(x)
#define CALL_sin(x) vector_sin(x)
#define CALL_cos(x) vector_cos(x)
#define CALL_tanh(x) vector_tanh(x)
#define CALL_abs(x) vector_abs(x)
#define CALL_sqrt(x) vector_sqrt(x)
#define CALL_sign(x) vector_sign(x)
#define CALL_pow(x, y) vector_pow(x, y)
