/* Passes over vectors of n numbers in an iteration of BiCGStab (mpm/numerics/bicgstab.py), each once through memory. */

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && __GNUC__ >= 12
#define FAST __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define FAST
#endif

/* a b */
FAST double dot(long n, const double *restrict a, const double *restrict b)
{
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (long k = 0; k < n; ++k)
        sum += a[k] * b[k];
    return sum;
}

/* r - alpha v in place of r; its square */
FAST double first_half(long n, double alpha, const double *restrict v, double *restrict r)
{
    double square = 0.0;
#pragma omp simd reduction(+ : square)
    for (long k = 0; k < n; ++k) {
        const double here = r[k] - alpha * v[k];
        r[k] = here;
        square += here * here;
    }
    return square;
}

/* sums = t r, t t, shadow r, shadow t */
FAST void shares(long n, const double *restrict t, const double *restrict r, const double *restrict shadow, double *restrict sums)
{
    double with = 0.0, square = 0.0, along_r = 0.0, along_t = 0.0;
#pragma omp simd reduction(+ : with, square, along_r, along_t)
    for (long k = 0; k < n; ++k) {
        with += t[k] * r[k];
        square += t[k] * t[k];
        along_r += shadow[k] * r[k];
        along_t += shadow[k] * t[k];
    }
    sums[0] = with;
    sums[1] = square;
    sums[2] = along_r;
    sums[3] = along_t;
}

/* x + alpha p + omega r in place of x, r - omega t in place of r, and then r + beta (p - omega v) in place of p */
FAST void second_half(long n, double alpha, double omega, double beta, const double *restrict v, const double *restrict t,
                      double *restrict x, double *restrict r, double *restrict p)
{
    for (long k = 0; k < n; ++k) {
        x[k] += alpha * p[k] + omega * r[k];
        const double here = r[k] - omega * t[k];
        r[k] = here;
        p[k] = here + beta * (p[k] - omega * v[k]);
    }
}
