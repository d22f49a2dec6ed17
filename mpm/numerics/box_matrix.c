/* Work on a BoxMatrix, cell after cell (mpm/numerics/box_matrix.py has the equations).

   A box has `columns` of `rows` cells, column after column, and UNKNOWNS per cell. Shapes, all contiguous:
   vectors (UNKNOWNS, cells); vectors with a column of a neighbour on either side (UNKNOWNS, rows + cells + rows);
   couplings (UNKNOWNS, 4, cells): entries that couple a cell to the one before it, after it (columns), below it and above it (rows);
   blocks (cells, UNKNOWNS, UNKNOWNS); what a neighbour's column adds to pivots (rows, UNKNOWNS, UNKNOWNS).
   Couplings below the first row and above the last are zero, so that nobody needs to ask where a column ends.
   Of one unknown, couplings that sweeps get are already multiplied by the inverse pivots. */

#define EACH(i) for (int i = 0; i < UNKNOWNS; ++i)
#define BLOCK (UNKNOWNS * UNKNOWNS)
#define IN(values, k, i, j) (values)[(k) * BLOCK + (i) * UNKNOWNS + (j)]
#define WEAKER(a, b) ((a) > (b) ? (a) : (b)) /* of two couplings, neither above zero */
#define COUPLING(which, i, k) couplings[(4L * (i) + which) * cells + (k)]
enum { BEFORE, AFTER, BELOW, ABOVE };

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

/* What pivots are found from and what is kept of them. */
typedef struct {
    int rows, columns;
    long cells;
    double relaxed;
    const double *couplings, *blocks, *from_start, *from_end;
    double *inverse, *excess, *swept;
} Pivots;

INSIDE void cell_pivot(const Pivots *s, int column, int row)
{
    const double *couplings = s->couplings, *blocks = s->blocks, *inverse = s->inverse;
    const int rows = s->rows;
    const long cells = s->cells, k = (long)column * rows + row;
    double pivot[BLOCK], into[UNKNOWNS];
    EACH(i) EACH(j) IN(pivot, 0, i, j) = IN(blocks, k, i, j);
    if (column > 0) {
        EACH(i) into[i] = COUPLING(BEFORE, i, k) + (row < rows - 1 ? s->relaxed * WEAKER(COUPLING(BELOW, i, k - rows + 1), COUPLING(ABOVE, i, k - rows)) : 0.0);
        EACH(i) EACH(j) IN(pivot, 0, i, j) -= into[i] * COUPLING(AFTER, j, k - rows) * IN(inverse, k - rows, i, j);
    } else {
        EACH(i) EACH(j) IN(pivot, 0, i, j) -= COUPLING(BEFORE, i, k) * IN(s->from_start, row, i, j);
    }
    if (column == s->columns - 1)
        EACH(i) EACH(j) IN(pivot, 0, i, j) -= COUPLING(AFTER, i, k) * IN(s->from_end, row, i, j);
    if (row > 0) {
        EACH(i) into[i] = COUPLING(BELOW, i, k) + (column < s->columns - 1 ? s->relaxed * WEAKER(COUPLING(BEFORE, i, k - 1 + rows), COUPLING(AFTER, i, k - 1)) : 0.0);
        EACH(i) EACH(j) IN(pivot, 0, i, j) -= into[i] * COUPLING(ABOVE, j, k - 1) * IN(inverse, k - 1, i, j);
    }
    invert(pivot);
    EACH(i) EACH(j) {
        double product = i == j ? -2.0 : 0.0;
        EACH(l) product += IN(pivot, 0, i, l) * IN(blocks, k, l, j);
        IN(s->excess, k, i, j) = product;
        IN(s->inverse, k, i, j) = IN(pivot, 0, i, j);
    }
#if UNKNOWNS == 1
    for (int which = 0; which < 4; ++which)
        s->swept[which * cells + k] = pivot[0] * COUPLING(which, 0, k);
#endif
}

/* P^-1, H = P^-1 D - 2 (`excess`) and, of one unknown, couplings times P^-1 (`swept`) in the columns from `first` to before `end`;
   `from_start`, `from_end`: what neighbours add to pivots of the first and the last column.
   Two columns at a time, the second one row behind the first: a processor has both under way while either waits for itself. */
FAST void find_pivots(int rows, int columns, int first, int end, double relaxed, const double *couplings, const double *blocks,
                      const double *from_start, const double *from_end, double *inverse, double *excess, double *swept)
{
    const Pivots s = {rows, columns, (long)rows * columns, relaxed, couplings, blocks, from_start, from_end, inverse, excess, swept};
    int column = first;
    for (; column < end - 1; column += 2)
        for (int row = 0; row <= rows; ++row) {
            if (row > 0)
                cell_pivot(&s, column + 1, row - 1);
            if (row < rows)
                cell_pivot(&s, column, row);
        }
    if (column == end - 1)
        for (int row = 0; row < rows; ++row)
            cell_pivot(&s, column, row);
}

/* What sweeps go through, and how far it is from one unknown to the next. */
typedef struct {
    long cells, width;
    const double *couplings, *inverse, *excess, *y;
    double *x, *result;
} Sweep;

/* `last` becomes there - P^-1 sum where `there` and all of `sum` but the term from `last` are known. */
INSIDE void settle(const Sweep *s, long k, int towards, const double *there, double *sum, double *last)
{
    const double *couplings = s->couplings;
    const long cells = s->cells;
#if UNKNOWNS == 1
    last[0] = (there[0] - sum[0]) - COUPLING(towards, 0, k) * last[0];
#else
    EACH(i) sum[i] += COUPLING(towards, i, k) * last[i];
    EACH(i) {
        last[i] = there[i];
        EACH(j) last[i] -= IN(s->inverse, k, i, j) * sum[j];
    }
#endif
}

/* x of cell k = y - P^-1 U x: `across` is that of the column after it, `last` that above it, then its own. */
INSIDE void cell_back(const Sweep *s, long k, int rows, int to_start, const double *across, double *last)
{
    const double *couplings = s->couplings;
    const long cells = s->cells, at = k + rows;
    double sum[UNKNOWNS], there[UNKNOWNS];
    EACH(i) sum[i] = COUPLING(AFTER, i, k) * across[i];
    if (to_start)
        EACH(i) sum[i] += COUPLING(BEFORE, i, k) * s->x[i * s->width + at - rows];
    EACH(i) there[i] = s->y[i * cells + k];
    settle(s, k, ABOVE, there, sum, last);
    EACH(i) s->x[i * s->width + at] = last[i];
}

/* f of cell k = y + H x - P^-1 L f: `across` is that of the column before it, `last` that below it, then its own; `beyond` that of a
   neighbour after it, or NULL. */
INSIDE void cell_on(const Sweep *s, long k, int rows, const double *beyond, const double *across, double *last)
{
    const double *couplings = s->couplings;
    const long cells = s->cells, at = k + rows;
    double sum[UNKNOWNS], there[UNKNOWNS];
    EACH(i) sum[i] = COUPLING(BEFORE, i, k) * across[i];
    if (beyond)
        EACH(i) sum[i] += COUPLING(AFTER, i, k) * beyond[i * rows];
    EACH(i) {
        there[i] = s->y[i * cells + k];
        EACH(j) there[i] += IN(s->excess, k, i, j) * s->x[j * s->width + at];
    }
    settle(s, k, BELOW, there, sum, last);
    EACH(i) s->result[i * cells + k] = s->x[i * s->width + at] + last[i];
}

/* x = y - P^-1 U x from column end-1 down to `first`; `to_start`: column `first` is coupled to a neighbour whose values x holds.
   Two columns at a time, as above. */
FAST void sweep_back(int rows, int columns, int first, int end, int to_start, const double *couplings, const double *inverse,
                     const double *y, double *x)
{
    const long cells = (long)rows * columns, width = cells + 2 * rows;
    const Sweep s = {cells, width, couplings, inverse, 0, y, x, 0};
    int column = end - 1;
    for (; column > first; column -= 2) {
        double one[UNKNOWNS] = {0.0}, two[UNKNOWNS] = {0.0}, across[UNKNOWNS];
        const long start = (long)column * rows, next = start - rows;
        for (int row = rows - 1; row >= -1; --row) {
            if (row < rows - 1)
                cell_back(&s, next + row + 1, rows, 0, one, two);
            if (row >= 0) {
                EACH(i) across[i] = x[i * width + start + row + 2 * rows];
                cell_back(&s, start + row, rows, 0, across, one);
            }
        }
    }
    if (column == first) {
        double one[UNKNOWNS] = {0.0}, across[UNKNOWNS];
        const long start = (long)column * rows;
        for (int row = rows - 1; row >= 0; --row) {
            EACH(i) across[i] = x[i * width + start + row + 2 * rows];
            cell_back(&s, start + row, rows, to_start, across, one);
        }
    }
}

/* f = y + H x - P^-1 L f from column `first` to before `end`, and x + f to `result`. `f` (UNKNOWNS, rows) holds the column before, then the
   last one; `beyond` (UNKNOWNS, rows) that of a neighbour to which column end-1 is coupled, or NULL. Two columns at a time, as above. */
FAST void sweep_on(int rows, int columns, int first, int end, const double *couplings, const double *inverse, const double *excess,
                   const double *beyond, const double *y, double *x, double *f, double *result)
{
    const long cells = (long)rows * columns, width = cells + 2 * rows;
    const Sweep s = {cells, width, couplings, inverse, excess, y, x, result};
    int column = first;
    for (; column < end - 1; column += 2) {
        double one[UNKNOWNS] = {0.0}, two[UNKNOWNS] = {0.0}, across[UNKNOWNS];
        const long start = (long)column * rows, next = start + rows;
        for (int row = 0; row <= rows; ++row) {
            if (row > 0) {
                cell_on(&s, next + row - 1, rows, 0, one, two);
                EACH(i) f[i * rows + row - 1] = two[i];
            }
            if (row < rows) {
                EACH(i) across[i] = f[i * rows + row];
                cell_on(&s, start + row, rows, 0, across, one);
            }
        }
    }
    if (column == end - 1) {
        double one[UNKNOWNS] = {0.0}, across[UNKNOWNS];
        const long start = (long)column * rows;
        for (int row = 0; row < rows; ++row) {
            EACH(i) across[i] = f[i * rows + row];
            cell_on(&s, start + row, rows, beyond ? beyond + row : 0, across, one);
            EACH(i) f[i * rows + row] = one[i];
        }
    }
}

/* The product with x, which has the neighbours' columns. */
FAST void product(int rows, int columns, const double *restrict couplings, const double *restrict blocks, const double *restrict x,
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

/* y + entries x in place of y in `count` cells. */
FAST void act(long count, const long *restrict cells, const double *restrict entries, const double *restrict x, double *restrict y)
{
    for (long k = 0; k < count; ++k)
        y[cells[k]] += entries[k] * x[cells[k]];
}

/* P^-1 times a vector. */
FAST void weigh(long cells, const double *restrict inverse, const double *restrict x, double *restrict y)
{
    EACH(i) for (long k = 0; k < cells; ++k) {
        double sum = 0.0;
        EACH(j) sum += IN(inverse, k, i, j) * x[j * cells + k];
        y[i * cells + k] = sum;
    }
}

/* Couplings of all cells with the neighbours at one side: what has their `numbers` is taken there, nothing where they are below zero. */
void couple(long cells, const long *restrict numbers, const double *restrict taken, double *restrict couplings)
{
    for (long k = 0; k < cells; ++k)
        couplings[k] = numbers[k] < 0 ? 0.0 : -taken[numbers[k]];
}
