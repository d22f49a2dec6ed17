/* The incomplete factor of a box, piece by piece with what neighbours tell each other, and BiCGStab (van der Vorst 1992) with it.

   An iteration goes through memory half as often as one of separate vector operations, adds up over ranks thrice, and starts again by itself
   where it breaks down. */

#define NOTHING_ALONG 1e-14 /* share of a residual along that of the start below which nothing is left of it but rounding */
#define ROUNDING 8.9e-16    /* of the difference of two squares */

/* Take `blocks` (cells, parts, parts) apart: what couples a cell to itself within each part to factor->own (parts, cells). */
static void take_apart(Factor *factor, long cells, const double *blocks)
{
    const long parts = factor->parts;
    for (long part = 0; part < parts; ++part)
        for (long k = 0; k < cells; ++k)
            factor->own[part * cells + k] = blocks[(k * parts + part) * parts + part];
}

/* What of them couples two parts, times the inverse pivots: entries above `least` times the diagonal one of the part that acts. */
static void pair_up(Factor *factor, long cells, double least, const double *blocks)
{
    const long parts = factor->parts;
    long count = 0;
    factor->acting = 0;
    for (long i = 0; i < parts; ++i)
        for (long j = 0; j < parts; ++j) {
            const double *inverse = factor->inverse + i * cells;
            const long before = count;
            if (i == j)
                continue;
            for (long k = 0; k < cells; ++k) {
                const double between = blocks[(k * parts + i) * parts + j];
                factor->cells[count] = k;
                factor->entries[count] = between * inverse[k];
                count += fabs(between) > least * fabs(blocks[(k * parts + j) * parts + j]);
            }
            if (count > before) {
                long *pair = factor->pairs + 3 * factor->acting++;
                pair[0] = i;
                pair[1] = j;
                pair[2] = count;
            }
        }
}

/* P of every part for `couplings` (parts, UNKNOWNS, 4, cells) and `blocks` (cells, unknowns, unknowns), those of all parts. */
void renew(Box *box, Factor *factor, double relaxed, double least, const double *couplings, const double *blocks, double *swept)
{
    Piece pieces[3];
    const int rows = box->rows, parts = factor->parts, count = pieces_of(box, pieces);
    const long cells = (long)rows * box->columns, length = rows * BLOCK, all = parts * length;
    double *from[2] = {factor->edges, factor->edges + all}, *ours = factor->edges + 2 * all;
    const double *own = parts > 1 ? factor->own : blocks;
    if (parts > 1)
        take_apart(factor, cells, blocks);
    for (int at = 0; at < count; ++at) {
        const Piece *piece = pieces + at;
        for (int side = START; side <= END; ++side)
            if (piece->at[side] && box->earlier[side])
                take(box, side, parts, length, length, from[side]);
        for (int part = 0; part < parts; ++part)
            find_pivots(rows, box->columns, piece->first, piece->end, relaxed, couplings + part * 4 * cells * UNKNOWNS,
                        own + part * cells * BLOCK, from[START] + part * length, from[END] + part * length,
                        factor->inverse + part * cells * BLOCK, factor->excess + part * cells * BLOCK, swept + part * 4 * cells);
        for (int side = START; side <= END; ++side) {
            if (!piece->at[side] || box->earlier[side])
                continue;
            const long edge = side == START ? 0 : cells - rows;
            for (long part = 0; part < parts; ++part)
                for (long row = 0; row < rows; ++row)
                    EACH(i) EACH(j) IN(ours + part * length, row, i, j) = IN(factor->inverse + part * cells * BLOCK, edge + row, i, j)
                        * couplings[(4 * (part * UNKNOWNS + j) + (side == START ? BEFORE : AFTER)) * cells + edge + row];
            give(box, side, parts, length, length, ours);
        }
    }
    finish(box);
    if (parts > 1)
        pair_up(factor, cells, least, blocks);
}

/* Go on with the pivots of other `blocks`, where those of these would be much the same: P^-1 D - 2, and what couples parts, are theirs. */
void follow(Box *box, Factor *factor, double least, const double *blocks)
{
    const long cells = (long)box->rows * box->columns, parts = factor->parts;
    const double *own = parts > 1 ? factor->own : blocks;
    if (parts > 1)
        take_apart(factor, cells, blocks);
    for (long k = 0; k < parts * cells; ++k)
        EACH(i) EACH(j) {
            double product = i == j ? -2.0 : 0.0;
            EACH(l) product += IN(factor->inverse, k, i, l) * IN(own, k, l, j);
            IN(factor->excess, k, i, j) = product;
        }
    if (parts > 1)
        pair_up(factor, cells, least, blocks);
}

/* x of (P + U) x = P y to factor->x. */
static void go_back(Box *box, Factor *factor, const double *y)
{
    Piece pieces[3];
    const int rows = box->rows, lists = factor->parts * UNKNOWNS;
    const long cells = (long)rows * box->columns, width = cells + 2 * rows;
    double *x = factor->x;
    for (int at = pieces_of(box, pieces) - 1; at >= 0; --at) {
        const Piece *piece = pieces + at;
        int to_start = 0;
        for (int side = START; side <= END; ++side)
            if (piece->at[side] && !box->earlier[side]) {
                take(box, side, lists, rows, width, x + (side == START ? 0 : cells + rows));
                to_start |= side == START;
            }
        for (int part = 0; part < factor->parts; ++part)
            sweep_back(rows, box->columns, piece->first, piece->end, to_start, factor->couplings + part * 4 * cells * UNKNOWNS,
                       factor->inverse + part * cells * BLOCK, y + part * cells * UNKNOWNS, x + part * width * UNKNOWNS);
        for (int side = START; side <= END; ++side)
            if (piece->at[side] && box->earlier[side])
                give(box, side, lists, rows, width, x + (side == START ? rows : cells));
    }
}

/* x + f of (P + L) f = P y + (D - 2 P) x to `result`. */
static void go_on(Box *box, Factor *factor, const double *y, double *x, double *result)
{
    Piece pieces[3];
    const int rows = box->rows, lists = factor->parts * UNKNOWNS, count = pieces_of(box, pieces);
    const long cells = (long)rows * box->columns, width = cells + 2 * rows;
    memset(factor->column, 0, (long)lists * rows * sizeof(double));
    for (int at = 0; at < count; ++at) {
        const Piece *piece = pieces + at;
        int to_end = 0;
        for (int side = START; side <= END; ++side)
            if (piece->at[side] && box->earlier[side]) {
                take(box, side, lists, rows, rows, side == START ? factor->column : factor->beyond);
                to_end |= side == END;
            }
        for (int part = 0; part < factor->parts; ++part)
            sweep_on(rows, box->columns, piece->first, piece->end, factor->couplings + part * 4 * cells * UNKNOWNS,
                     factor->inverse + part * cells * BLOCK, factor->excess + part * cells * BLOCK,
                     to_end ? factor->beyond + part * rows * UNKNOWNS : 0, y + part * cells * UNKNOWNS, x + part * width * UNKNOWNS,
                     factor->column + part * rows * UNKNOWNS, result + part * cells * UNKNOWNS);
        for (int side = START; side <= END; ++side)
            if (piece->at[side] && !box->earlier[side])
                give(box, side, lists, rows, rows, factor->column);
    }
}

/* What BiCGStab sees of the matrix, (P + L)^-1 A (P + U)^-1 P y. */
static void see(Box *box, Factor *factor, const double *y, double *result)
{
    const long cells = (long)box->rows * box->columns;
    go_back(box, factor, y);
    if (factor->acting) {
        memcpy(factor->y, y, factor->parts * cells * sizeof(double));
        y = factor->y;
    }
    for (long pair = 0, from = 0; pair < factor->acting; ++pair) {
        const long *here = factor->pairs + 3 * pair;
        act(here[2] - from, factor->cells + from, factor->entries + from, factor->x + here[1] * (cells + 2 * box->rows) + box->rows,
            factor->y + here[0] * cells);
        from = here[2];
    }
    go_on(box, factor, y, factor->x, result);
}

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

/* x + alpha p in place of x */
FAST void add_to(long n, double alpha, const double *restrict p, double *restrict x)
{
    for (long k = 0; k < n; ++k)
        x[k] += alpha * p[k];
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

/* A x = rhs from a guess of nothing, x (parts, UNKNOWNS, cells). It stops where the 2-norm of the residual, over P + L, is not above
   `tolerance` times its first one, or `least`. Returns the number of iterations n, or -1 - n where more than `limit` would be needed or numbers
   are none; `left` becomes the square of that norm. */
int solve(Box *box, Factor *factor, const double *rhs, double tolerance, double least, int limit, double *x, double *left)
{
    const int parts = factor->parts;
    const long cells = (long)box->rows * box->columns, n = parts * UNKNOWNS * cells, width = cells + 2 * box->rows;
    double *r = factor->r, *p = factor->p, *v = factor->v, *t = factor->t, *shadow = factor->shadow;
    int iteration = 0, done = 0;
    for (int part = 0; part < parts; ++part)
        weigh(cells, factor->inverse + part * cells * BLOCK, rhs + part * cells * UNKNOWNS, p + part * cells * UNKNOWNS);
    go_on(box, factor, p, factor->nothing, r);
    memset(x, 0, n * sizeof(double));
    double square = dot(n, r, r), started = 0.0, rho = 0.0; /* squared residual and its part along the shadow, since the start */
    add_up(box, 1, &square);
    const double goal = fmax(tolerance * tolerance * square, least * least);
    for (; iteration <= limit && isfinite(square) && !box->error; ++iteration) {
        if (square <= goal) {
            done = 1;
            break;
        }
        const int fresh = rho * rho <= NOTHING_ALONG * NOTHING_ALONG * square * started;
        if (fresh) {
            memcpy(shadow, r, n * sizeof(double));
            memcpy(p, r, n * sizeof(double));
            started = rho = square;
        }
        see(box, factor, p, v);
        double along = dot(n, shadow, v);
        add_up(box, 1, &along);
        if (along == 0.0 && !fresh) {
            rho = 0.0; /* starts again */
            continue;
        }
        if (along == 0.0 || !isfinite(along))
            break;
        const double alpha = rho / along;
        double sums[4];
        double half = first_half(n, alpha, v, r);
        add_up(box, 1, &half);
        if (half <= goal) { /* half an iteration was enough */
            add_to(n, alpha, p, x);
            square = half;
            continue;
        }
        see(box, factor, r, t);
        shares(n, t, r, shadow, sums);
        add_up(box, 4, sums);
        const double omega = sums[1] > 0.0 ? sums[0] / sums[1] : 0.0;
        const double now = sums[2] - omega * sums[3], beta = omega != 0.0 ? now / rho * alpha / omega : 0.0;
        second_half(n, alpha, omega, beta, v, t, x, r, p);
        square = half - omega * sums[0];
        if (square < ROUNDING * half) /* what is no number stays so */
            square = ROUNDING * half;
        rho = omega != 0.0 ? now : 0.0; /* else it starts again */
    }
    go_back(box, factor, x);
    for (long i = 0; i < (long)parts * UNKNOWNS; ++i)
        memcpy(x + i * cells, factor->x + i * width + box->rows, cells * sizeof(double));
    finish(box);
    *left = square;
    return done ? iteration : -1 - iteration;
}

/* rhs - result in place of a result; adds the squares of rhs and of that, over the diagonal, and of x. */
FAST void compare(long cells, const double *restrict diagonal, const double *restrict x, const double *restrict rhs,
                  double *restrict result, double *restrict squares)
{
    double all = 0.0, left = 0.0, known = 0.0;
#pragma omp simd reduction(+ : all, left, known)
    for (long k = 0; k < cells; ++k) {
        const double share = 1.0 / diagonal[k * BLOCK], missing = rhs[k] - result[k];
        result[k] = missing;
        all += rhs[k] * share * (rhs[k] * share);
        left += missing * share * (missing * share);
        known += x[k] * x[k];
    }
    squares[0] += all;
    squares[1] += left;
    squares[2] += known;
}

/* A x to `result`; x (UNKNOWNS, rows + cells + rows) gets the columns of neighbours. */
void multiply(Box *box, const double *couplings, const double *blocks, double *x, double *result)
{
    const int rows = box->rows;
    const long cells = (long)rows * box->columns, width = cells + 2 * rows;
    for (int side = START; side <= END; ++side)
        if (box->neighbour[side] >= 0)
            give(box, side, UNKNOWNS, rows, width, x + (side == START ? rows : cells));
    for (int side = START; side <= END; ++side)
        if (box->neighbour[side] >= 0)
            take(box, side, UNKNOWNS, rows, width, x + (side == START ? 0 : cells + rows));
    finish(box);
    product(rows, box->columns, couplings, blocks, x, result);
}

/* rhs - A x to `result`; squares = of rhs and of that over the diagonal, and of x; x as in `multiply`. */
void miss(Box *box, const double *couplings, const double *blocks, double *x, const double *rhs, double *result, double *squares)
{
    const long cells = (long)box->rows * box->columns, width = cells + 2 * box->rows;
    multiply(box, couplings, blocks, x, result);
    memset(squares, 0, 3 * sizeof(double));
    EACH(i) compare(cells, blocks + i * (UNKNOWNS + 1), x + i * width + box->rows, rhs + i * cells, result + i * cells, squares);
}
