/* Passes over vectors of n numbers in an iteration of BiCGStab (mpm/numerics/bicgstab.py), each once through memory. */

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__)
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

/* sums[0], sums[1] = t r, t t */
FAST void shares(long n, const double *restrict t, const double *restrict r, double *restrict sums)
{
    double with = 0.0, square = 0.0;
#pragma omp simd reduction(+ : with, square)
    for (long k = 0; k < n; ++k) {
        with += t[k] * r[k];
        square += t[k] * t[k];
    }
    sums[0] = with;
    sums[1] = square;
}

/* x + alpha p + omega r in place of x, then r - omega t in place of r; sums[0], sums[1] = r r, shadow r */
FAST void second_half(long n, double alpha, double omega, const double *restrict p, const double *restrict t,
                      const double *restrict shadow, double *restrict x, double *restrict r, double *restrict sums)
{
    double square = 0.0, along = 0.0;
#pragma omp simd reduction(+ : square, along)
    for (long k = 0; k < n; ++k) {
        x[k] += alpha * p[k] + omega * r[k];
        const double here = r[k] - omega * t[k];
        r[k] = here;
        square += here * here;
        along += shadow[k] * here;
    }
    sums[0] = square;
    sums[1] = along;
}

/* r + beta (p - omega v) in place of p */
FAST void turn(long n, double beta, double omega, const double *restrict r, const double *restrict v, double *restrict p)
{
    for (long k = 0; k < n; ++k)
        p[k] = r[k] + beta * (p[k] - omega * v[k]);
}
