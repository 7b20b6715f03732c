/* Batch evaluation of one model: the model's own C, compiled for vectors over samples.

   A group of LANES samples is read from (N, n) arrays of any strides, turned into one vector per joint (with cos
   and sin), evaluated at once and written out. Included after vector.h and the model's C, with
   JOINTS, CHANNELS, ENTRIES, EXTRAS, COLUMNS and TORQUE defined. */

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#if defined(__clang__)
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (integers){__VA_ARGS__})
#endif
#define AT_LEAST_ONE(x) ((x) > 0 ? (x) : 1)

typedef struct { const double *data; ptrdiff_t row, column; } table; /* strides in doubles */
typedef struct { table q, dq, ddq, sign, extra; } samples;           /* sign.data == 0: sign(dq) */
typedef struct {
    vector c[JOINTS], s[JOINTS], q[JOINTS], dq[JOINTS], ddq[JOINTS], sign[JOINTS], one, extra[AT_LEAST_ONE(EXTRAS)];
    vector nothing; /* 0 times everything that was read: not 0 in a sample that is not finite */
} state;

static inline vector choose(integers mask, vector yes, vector no)
{
    return (vector)(((integers)yes & mask) | ((integers)no & ~mask));
}

/* cos and sin, within 1 ulp or so for |x| < 1e4 (Cody and Waite's pi/2 in three parts, fdlibm's polynomials);
   beyond that, and for infinities and NaN, libm lane by lane. */
static inline void cos_sin(vector x, vector *c, vector *s)
{
    const vector zero = broadcast(0.0);
    const integers sign_bit = (integers)broadcast(-0.0);
    integers tame = (integers)((vector)((integers)x & ~sign_bit) < zero + 1e4);
    const double magic = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer */
    vector t = x * 0.63661977236758134308 + magic;
    vector k = t - magic;
    vector r = x - k * 1.57079632673412561417e+00; /* 33 bits each: the products are exact */
    r = r - k * 6.07710050630396597660e-11;
    r = r - k * 2.02226624879595063154e-21;
    vector z = r * r;
    vector sine = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 +
        z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 +
        z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    vector half = 0.5 * z;
    vector rest = 1.0 - half;
    vector cosine = rest + ((1.0 - rest) - half + z * z * (4.16666666666666019037e-02 +
        z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 +
        z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
    integers quadrant = (integers)t;
    integers odd = -(quadrant & 1);
    *s = (vector)((integers)choose(odd, cosine, sine) ^ ((quadrant & 2) << 62));
    *c = (vector)((integers)choose(odd, sine, cosine) ^ (((quadrant + 1) & 2) << 62));
    int64_t all = -1;
    for (int l = 0; l < LANES; ++l) all &= tame[l];
    if (__builtin_expect(!all, 0))
        for (int l = 0; l < LANES; ++l)
            if (!tame[l]) {
                (*c)[l] = cos(x[l]);
                (*s)[l] = sin(x[l]);
            }
}

/* -1, 0 or 1; NaN stays NaN */
static inline vector sign_of(vector x)
{
    const vector zero = broadcast(0.0), one = broadcast(1.0);
    vector s = choose((integers)(x > zero), one, choose((integers)(x < zero), -one, x));
    return s;
}

/* LANES vectors of LANES numbers: rows become columns. Lane by lane a compiler loads and inserts every number. */
static inline void transpose(vector *v)
{
    vector w[LANES];
#if LANES == 8
    for (int i = 0; i < 8; i += 2) {
        w[i] = SHUFFLE(v[i], v[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
        w[i + 1] = SHUFFLE(v[i], v[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    }
    for (int i = 0; i < 8; i += 4)
        for (int k = 0; k < 2; ++k) {
            v[i + k] = SHUFFLE(w[i + k], w[i + k + 2], 0, 1, 8, 9, 4, 5, 12, 13);
            v[i + k + 2] = SHUFFLE(w[i + k], w[i + k + 2], 2, 3, 10, 11, 6, 7, 14, 15);
        }
    for (int k = 0; k < 4; ++k) {
        w[k] = SHUFFLE(v[k], v[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
        w[k + 4] = SHUFFLE(v[k], v[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
    }
#elif LANES == 4
    for (int i = 0; i < 4; i += 2) {
        w[i] = SHUFFLE(v[i], v[i + 1], 0, 4, 2, 6);
        w[i + 1] = SHUFFLE(v[i], v[i + 1], 1, 5, 3, 7);
    }
    for (int k = 0; k < 2; ++k) {
        v[k] = SHUFFLE(w[k], w[k + 2], 0, 1, 4, 5);
        v[k + 2] = SHUFFLE(w[k], w[k + 2], 2, 3, 6, 7);
    }
    memcpy(w, v, sizeof w);
#else
    w[0] = SHUFFLE(v[0], v[1], 0, 2);
    w[1] = SHUFFLE(v[0], v[1], 1, 3);
#endif
    memcpy(v, w, sizeof w);
}

/* Samples first .. first + LANES - 1 as vectors; the last sample stands in for those that are not there. */
static inline void read_table(const table *t, ptrdiff_t first, ptrdiff_t last, int columns, vector *out)
{
    if (t->row == 1 && first + LANES <= last) {
        for (int j = 0; j < columns; ++j) out[j] = *(const loose_vector *)(t->data + first + j * t->column);
        return;
    }
    const double *p[LANES];
    for (int l = 0; l < LANES; ++l) p[l] = t->data + (first + l < last ? first + l : last - 1) * t->row;
    if (t->column == 1 && t->row > 0 && first + 2 * LANES <= last) { /* whole vectors, into later samples' rows */
        for (int j = 0; j < columns; j += LANES) {
            vector v[LANES];
            for (int l = 0; l < LANES; ++l) v[l] = *(const loose_vector *)(p[l] + j);
            transpose(v);
            for (int l = 0; l < LANES && j + l < columns; ++l) out[j + l] = v[l];
        }
    } else if (t->column == 1) {
        for (int j = 0; j < columns; ++j) {
            vector v = broadcast(0.0);
            for (int l = 0; l < LANES; ++l) v[l] = p[l][j];
            out[j] = v;
        }
    } else {
        for (int j = 0; j < columns; ++j) {
            vector v = broadcast(0.0);
            for (int l = 0; l < LANES; ++l) v[l] = p[l][j * t->column];
            out[j] = v;
        }
    }
}

static __attribute__((noinline)) void read_state(const samples *in, ptrdiff_t first, ptrdiff_t last, state *x)
{
    read_table(&in->q, first, last, JOINTS, x->q);
    read_table(&in->dq, first, last, JOINTS, x->dq);
    read_table(&in->ddq, first, last, JOINTS, x->ddq);
    for (int j = 0; j < JOINTS; ++j) cos_sin(x->q[j], &x->c[j], &x->s[j]);
    vector sum = broadcast(0.0); /* one that overflows only has the samples looked at */
    for (int j = 0; j < JOINTS; ++j) sum += x->q[j] + x->dq[j] + x->ddq[j];
    if (in->sign.data) {
        read_table(&in->sign, first, last, JOINTS, x->sign);
        for (int j = 0; j < JOINTS; ++j) sum += x->sign[j];
    } else
        for (int j = 0; j < JOINTS; ++j) x->sign[j] = sign_of(x->dq[j]);
    if (EXTRAS) {
        read_table(&in->extra, first, last, EXTRAS, x->extra);
        for (int j = 0; j < EXTRAS; ++j) sum += x->extra[j];
    }
    x->nothing = sum * 0.0;
    x->one = broadcast(1.0);
}

/* 1 if what was read was finite in every sample */
static inline int all_finite(vector nothing)
{
    int all = 1;
    for (int l = 0; l < LANES; ++l) all &= nothing[l] == 0.0;
    return all;
}

static __attribute__((noinline)) void columns_of(const state *x, entries W)
{
    COLUMNS(x->c, x->s, x->q, x->dq, x->ddq, x->sign, x->extra, W);
}

/* A source of a non-zero: 0 .. ENTRIES - 1 an entry; behind them dq (n), ddq (n), sign (n), 1. */
#define SIGNALS (3 * JOINTS + 1)

static inline const vector *signals_of(const state *x) /* dq, ddq, sign, one stand in a row */
{
    return (const vector *)((const char *)x + offsetof(state, dq));
}

/* Samples next .. last - 1, `block` of them (a multiple of LANES) at a time, each time into the same rows: entry k of a
   block's sample i goes to row[k][i]; then copies: source copy_of[k] goes to copy_row[k][i]. */
typedef struct {
    const samples *in;
    ptrdiff_t next, last, block;
    double *const *row;
    ptrdiff_t copies;
    const int32_t *copy_of;
    double *const *copy_row;
} stream;

/* The next block of a stream. Returns 1 if all its inputs are finite. A call with one argument: between two of them a
   thread holds the interpreter's lock, and another one that wants it meanwhile sleeps for longer than a block takes. */
int dynident_block(stream *s)
{
    const ptrdiff_t first = s->next, last = s->last - first < s->block ? s->last : first + s->block;
    vector nothing = broadcast(0.0);
    for (ptrdiff_t i = first; i < last; i += LANES) {
        state x;
        read_state(s->in, i, last, &x);
        nothing += x.nothing;
        columns_of(&x, (entries){s->row, i - first});
        const vector *signal = signals_of(&x);
        for (ptrdiff_t k = 0; k < s->copies; ++k) {
            int32_t from = s->copy_of[k];
            loose_vector *to = (loose_vector *)(s->copy_row[k] + (i - first));
            if (from < ENTRIES) *to = *(const loose_vector *)(s->row[from] + (i - first));
            else *to = signal[from - ENTRIES];
        }
    }
    s->next = last;
    return all_finite(nothing);
}

static inline void write_through(double *to, const double *from, ptrdiff_t count)
{
#if defined(__x86_64__)
    ptrdiff_t k = 0;
    for (; k < count && ((uintptr_t)(to + k) & (8 * LANES - 1)); ++k) {
        long long bits;
        memcpy(&bits, from + k, 8);
        _mm_stream_si64((long long *)(to + k), bits);
    }
    for (; k + LANES <= count; k += LANES) {
#if LANES == 8
        _mm512_stream_pd(to + k, _mm512_loadu_pd(from + k));
#elif LANES == 4
        _mm256_stream_pd(to + k, _mm256_loadu_pd(from + k));
#else
        _mm_stream_pd(to + k, _mm_loadu_pd(from + k));
#endif
    }
    for (; k < count; ++k) {
        long long bits;
        memcpy(&bits, from + k, 8);
        _mm_stream_si64((long long *)(to + k), bits);
    }
#else
    memcpy(to, from, count * sizeof(double));
#endif
}

/* W (N, width) whole, row after row: non-zero k of a sample is source[k] and stands at target[k]. `sample_row` holds
   `width` zeros. `past_caches`: W is larger than the caches, write it without reading it first. Returns 1 if all
   inputs are finite. */
int dynident_dense(const samples *in, ptrdiff_t first, ptrdiff_t last, double *W, ptrdiff_t width, ptrdiff_t nonzeros,
                    const int32_t *source, const int32_t *target, double *sample_row, int past_caches)
{
    vector cell[ENTRIES + SIGNALS];
    double *row[AT_LEAST_ONE(ENTRIES)];
    for (int k = 0; k < ENTRIES; ++k) row[k] = (double *)&cell[k];
    vector nothing = broadcast(0.0);
    for (ptrdiff_t i = first; i < last; i += LANES) {
        state x;
        read_state(in, i, last, &x);
        nothing += x.nothing;
        columns_of(&x, (entries){row, 0});
        memcpy(cell + ENTRIES, signals_of(&x), SIGNALS * sizeof(vector));
        for (int l = 0; l < LANES && i + l < last; ++l) {
            const double *from = (const double *)cell + l;
            for (ptrdiff_t k = 0; k < nonzeros; ++k) sample_row[target[k]] = from[(ptrdiff_t)source[k] * LANES];
            if (past_caches) write_through(W + (i + l) * width, sample_row, width);
            else memcpy(W + (i + l) * width, sample_row, width * sizeof(double));
        }
    }
#if defined(__x86_64__)
    _mm_sfence();
#endif
    return all_finite(nothing);
}

/* tau (N, CHANNELS), row after row, of base parameters chi. Returns 1 if all inputs are finite. */
int dynident_torque(const samples *in, ptrdiff_t first, ptrdiff_t last, const double *chi, double *tau)
{
    enum { WHOLE = (CHANNELS + LANES - 1) / LANES * LANES };
    vector cell[WHOLE];
    double *row[CHANNELS];
    for (int k = 0; k < CHANNELS; ++k) row[k] = (double *)&cell[k];
    for (int k = CHANNELS; k < WHOLE; ++k) cell[k] = broadcast(0.0);
    vector nothing = broadcast(0.0);
    for (ptrdiff_t i = first; i < last; i += LANES) {
        state x;
        read_state(in, i, last, &x);
        nothing += x.nothing;
        TORQUE(x.c, x.s, x.q, x.dq, x.ddq, x.sign, x.extra, chi, (entries){row, 0});
        if (i + 2 * LANES <= last) { /* whole vectors: what they spill, the next sample's row writes over */
            vector by_sample[WHOLE];
            memcpy(by_sample, cell, sizeof cell);
            for (int k = 0; k < WHOLE; k += LANES) transpose(by_sample + k);
            for (int l = 0; l < LANES; ++l)
                for (int k = 0; k < WHOLE; k += LANES)
                    *(loose_vector *)(tau + (i + l) * CHANNELS + k) = by_sample[k + l];
        } else
            for (int l = 0; l < LANES && i + l < last; ++l)
                for (int k = 0; k < CHANNELS; ++k) tau[(i + l) * CHANNELS + k] = cell[k][l];
    }
    return all_finite(nothing);
}

/* For tests: cos and sin of `count` numbers. */
void dynident_cos_sin(const double *x, double *c, double *s, ptrdiff_t count)
{
    for (ptrdiff_t i = 0; i + LANES <= count; i += LANES) {
        vector cosine, sine;
        cos_sin(*(const loose_vector *)(x + i), &cosine, &sine);
        *(loose_vector *)(c + i) = cosine;
        *(loose_vector *)(s + i) = sine;
    }
}
