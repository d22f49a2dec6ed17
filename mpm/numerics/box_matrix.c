/* Work of a BoxMatrix, cell after cell (mpm/numerics/box_matrix.py has the equations).

   A box has `columns` of `rows` cells, column after column, and UNKNOWNS per cell. Shapes, all contiguous:
   vectors (UNKNOWNS, cells); vectors with a column of a neighbour on either side (UNKNOWNS, rows + cells + rows);
   couplings (UNKNOWNS, 4, cells): entries that couple a cell to the one before it, after it (columns), below it and above it (rows);
   blocks (cells, UNKNOWNS, UNKNOWNS); what a neighbour's column adds to pivots (rows, UNKNOWNS, UNKNOWNS).
   Couplings below the first row and above the last are zero, so that nobody needs to ask where a column ends.
   Of one unknown, couplings that sweeps get are already multiplied by the inverse pivots. */

#define EACH(i) for (int i = 0; i < UNKNOWNS; ++i)
#define BLOCK (UNKNOWNS * UNKNOWNS)
#define IN(values, k, i, j) (values)[(k) * BLOCK + (i) * UNKNOWNS + (j)]
#define COUPLING(which, i, k) couplings[(4L * (i) + which) * cells + (k)]
enum { BEFORE, AFTER, BELOW, ABOVE };

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__)
#define FAST __attribute__((target_clones("arch=x86-64-v3", "default"))) /* multiplies and adds at once where the processor can */
#else
#define FAST
#endif

/* Invert a block by elimination with pivots on the diagonal, in place. */
static inline void invert(double *a)
{
    EACH(k) {
        const double pivot = 1.0 / IN(a, 0, k, k);
        IN(a, 0, k, k) = 1.0;
        EACH(j) IN(a, 0, k, j) *= pivot;
        EACH(i) {
            if (i == k)
                continue;
            const double times = IN(a, 0, i, k);
            IN(a, 0, i, k) = 0.0;
            EACH(j) IN(a, 0, i, j) -= times * IN(a, 0, k, j);
        }
    }
}

/* P^-1, H = P^-1 D - 2 (`excess`) and, of one unknown, couplings times P^-1 (`swept`) in the columns from `first` to before `end`;
   `from_start`, `from_end`: what neighbours add to pivots of the first and the last column. */
FAST void find_pivots(int rows, int columns, int first, int end, double relaxed, const double *couplings, const double *blocks,
                      const double *from_start, const double *from_end, double *inverse, double *excess, double *swept)
{
    const long cells = (long)rows * columns;
    for (int column = first; column < end; ++column) {
        for (int row = 0; row < rows; ++row) {
            const long k = (long)column * rows + row;
            double pivot[BLOCK], into[UNKNOWNS];
            EACH(i) EACH(j) IN(pivot, 0, i, j) = IN(blocks, k, i, j);
            if (column > 0) {
                EACH(i) into[i] = COUPLING(BEFORE, i, k) + (row < rows - 1 ? relaxed * COUPLING(BELOW, i, k - rows + 1) : 0.0);
                EACH(i) EACH(j) IN(pivot, 0, i, j) -= into[i] * IN(inverse, k - rows, i, j) * COUPLING(AFTER, j, k - rows);
            } else {
                EACH(i) EACH(j) IN(pivot, 0, i, j) -= COUPLING(BEFORE, i, k) * IN(from_start, row, i, j);
            }
            if (column == columns - 1)
                EACH(i) EACH(j) IN(pivot, 0, i, j) -= COUPLING(AFTER, i, k) * IN(from_end, row, i, j);
            if (row > 0) {
                EACH(i) into[i] = COUPLING(BELOW, i, k) + (column < columns - 1 ? relaxed * COUPLING(BEFORE, i, k - 1 + rows) : 0.0);
                EACH(i) EACH(j) IN(pivot, 0, i, j) -= into[i] * COUPLING(ABOVE, j, k - 1) * IN(inverse, k - 1, i, j);
            }
            invert(pivot);
            EACH(i) EACH(j) {
                double product = i == j ? -2.0 : 0.0;
                EACH(l) product += IN(pivot, 0, i, l) * IN(blocks, k, l, j);
                IN(excess, k, i, j) = product;
                IN(inverse, k, i, j) = IN(pivot, 0, i, j);
            }
#if UNKNOWNS == 1
            for (int which = 0; which < 4; ++which)
                swept[which * cells + k] = pivot[0] * COUPLING(which, 0, k);
#endif
        }
    }
}

/* x = y - P^-1 U x from column end-1 down to `first`; `to_start`: column `first` is coupled to a neighbour whose values x holds. */
FAST void sweep_back(int rows, int columns, int first, int end, int to_start, const double *restrict couplings,
                     const double *restrict inverse, const double *restrict y, double *restrict x)
{
    const long cells = (long)rows * columns, width = cells + 2 * rows;
    double last[UNKNOWNS];
    EACH(i) last[i] = x[i * width + (long)(end + 1) * rows];
    for (long k = (long)end * rows - 1; k >= (long)first * rows; --k) {
        const long at = k + rows;
        double sum[UNKNOWNS];
        EACH(i) sum[i] = COUPLING(AFTER, i, k) * x[i * width + at + rows];
        if (to_start)
            EACH(i) sum[i] += COUPLING(BEFORE, i, k) * x[i * width + at - rows];
#if UNKNOWNS == 1
        last[0] = (y[k] - sum[0]) - COUPLING(ABOVE, 0, k) * last[0];
#else
        EACH(i) sum[i] += COUPLING(ABOVE, i, k) * last[i];
        EACH(i) {
            last[i] = y[i * cells + k];
            EACH(j) last[i] -= IN(inverse, k, i, j) * sum[j];
        }
#endif
        EACH(i) x[i * width + at] = last[i];
    }
}

/* f = y + H x - P^-1 L f from column `first` to before `end`, and x + f to `result`; `to_end`: column end-1 is coupled to
   a neighbour whose values f holds. */
FAST void sweep_on(int rows, int columns, int first, int end, int to_end, const double *restrict couplings,
                   const double *restrict inverse, const double *restrict excess, const double *restrict y, const double *restrict x,
                   double *restrict f, double *restrict result)
{
    const long cells = (long)rows * columns, width = cells + 2 * rows;
    double last[UNKNOWNS];
    EACH(i) last[i] = f[i * width + (long)(first + 1) * rows - 1];
    for (long k = (long)first * rows; k < (long)end * rows; ++k) {
        const long at = k + rows;
        double sum[UNKNOWNS], there[UNKNOWNS];
        EACH(i) sum[i] = COUPLING(BEFORE, i, k) * f[i * width + at - rows];
        if (to_end)
            EACH(i) sum[i] += COUPLING(AFTER, i, k) * f[i * width + at + rows];
        EACH(i) {
            there[i] = y[i * cells + k];
            EACH(j) there[i] += IN(excess, k, i, j) * x[j * width + at];
        }
#if UNKNOWNS == 1
        last[0] = (there[0] - sum[0]) - COUPLING(BELOW, 0, k) * last[0];
#else
        EACH(i) sum[i] += COUPLING(BELOW, i, k) * last[i];
        EACH(i) {
            last[i] = there[i];
            EACH(j) last[i] -= IN(inverse, k, i, j) * sum[j];
        }
#endif
        EACH(i) {
            f[i * width + at] = last[i];
            result[i * cells + k] = x[i * width + at] + last[i];
        }
    }
}

/* The product with x, which has the neighbours' columns. */
FAST void multiply(int rows, int columns, const double *restrict couplings, const double *restrict blocks, const double *restrict x,
                   double *restrict result)
{
    const long cells = (long)rows * columns, width = cells + 2 * rows;
    EACH(i) {
        const double *here = x + i * width + rows;
        for (long k = 0; k < cells; ++k) {
            double sum = COUPLING(BEFORE, i, k) * here[k - rows] + COUPLING(AFTER, i, k) * here[k + rows]
                         + COUPLING(BELOW, i, k) * here[k - 1] + COUPLING(ABOVE, i, k) * here[k + 1];
            EACH(j) sum += IN(blocks, k, i, j) * x[j * width + rows + k];
            result[i * cells + k] = sum;
        }
    }
}
