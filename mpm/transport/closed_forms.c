/* Reactions in the equations of a time step, cell after cell (equations: mpm/transport/closed_forms.py and mpm/physics/kinetics.py).

   Shapes, all contiguous: concentrations, fluxes, `diagonal` and `rhs` (UNKNOWNS, own); blocks (own, UNKNOWNS, UNKNOWNS); coverages (2,
   reactive); events (SURFACE, reactive) and (GAS, own).
   Cells are done in tiles: what is known of them in between stays close to the processor, which does several of them at once. */

#define TILE 64
#define ROOM(count) ((count) > 0 ? (count) : 1)
#define EACH(i) for (int i = 0; i < UNKNOWNS; ++i)
#define CELLS(n, count) for (long n = 0; n < (count); ++n)
#define TOGETHER(n, count) _Pragma("omp simd") CELLS(n, count) /* none of them knows of another */
#define POSITIVE(a) ((a) > 0.0 ? (a) : 0.0)

/* Concentrations in some cells, what reactions make of each gas there [mol/m/s] and how that changes with each [m2/s]. */
typedef struct {
    double c[UNKNOWNS][TILE], made[UNKNOWNS][TILE], slope[UNKNOWNS][UNKNOWNS][TILE];
} Tile;

INSIDE void clear(Tile *t)
{
    memset(t->made, 0, sizeof t->made);
    memset(t->slope, 0, sizeof t->slope);
}

/* Values of cells `here`, or without a list of those from `first`. */
INSIDE void pick(double *values, const double *from, long count, const long *here, long first)
{
    if (here)
        TOGETHER(n, count) values[n] = from[here[n]];
    else
        memcpy(values, from + first, count * sizeof(double));
}

/* Add one reaction with these `events` and their `slopes`, of which each makes `made`. */
INSIDE void count_in(Tile *t, long count, const double *made, const double *events, const double (*slopes)[TILE])
{
    EACH(i) {
        TOGETHER(n, count) t->made[i][n] += made[i] * events[n];
        EACH(j) TOGETHER(n, count) t->slope[i][j][n] += made[i] * slopes[j][n];
    }
}

/* Add the reactions of gases with the sites of reactive cells `here`, or without a list of those from `first`; theta' follows the gas as in
   SurfaceKinetics.rates. */
INSIDE void on_surfaces(const Reacting *s, Tile *t, long count, const long *here, long first, double dt, const double *theta,
                        double (*events)[TILE])
{
    double gain[2][TILE] = {{0.0}}, now[2][TILE], inverse[TILE], share[ROOM(SURFACE)][TILE], slopes[UNKNOWNS][TILE];
    pick(now[0], theta, count, here, first);
    pick(now[1], theta + s->reactive, count, here, first);
    for (int r = 0; r < SURFACE; ++r) {
        const double *c = t->c[s->gas[r]], times = dt * s->gain[r];
        double *into = gain[1 - s->site[r]];
        pick(share[r], s->turnover + r * s->reactive, count, here, first);
        TOGETHER(n, count) {
            share[r][n] *= times;
            into[n] += share[r][n] * POSITIVE(c[n]);
        }
    }
    TOGETHER(n, count) {
        inverse[n] = 1.0 / (1.0 + gain[0][n] + gain[1][n]);
        now[0][n] = (now[0][n] + gain[0][n]) * inverse[n];
        now[1][n] = (now[1][n] + gain[1][n]) * inverse[n];
    }
    for (int r = 0; r < SURFACE; ++r) {
        const int g = s->gas[r], site = s->site[r];
        const double *c = t->c[g];
        double strength[TILE], answering[TILE];
        pick(strength, s->on_area + r * s->reactive, count, here, first);
        memset(slopes, 0, sizeof slopes);
        TOGETHER(n, count) {
            slopes[g][n] = strength[n] * now[site][n];
            events[r][n] = slopes[g][n] * c[n];
            answering[n] = strength[n] * inverse[n] * POSITIVE(c[n]);
        }
        for (int other = 0; other < SURFACE; ++other) { /* how the coverage answers to the gas of each reaction */
            const int j = s->gas[other], from = s->site[other];
            const double sign = from == site ? -1.0 : 1.0;
            TOGETHER(n, count) {
                const double answer = sign * answering[n] * share[other][n] * now[from][n];
                slopes[j][n] += answer;
                if (j != g) /* along the tangent below zero */
                    events[r][n] -= answer * POSITIVE(-t->c[j][n]);
            }
        }
        count_in(t, count, s->made_on_area + r * UNKNOWNS, events[r], slopes);
    }
}

/* Add the reactions of two gases in own cells `here`, or without a list in those from `first`. */
INSIDE void in_volume(const Reacting *s, Tile *t, long count, const long *here, long first, double (*events)[TILE])
{
    double slopes[UNKNOWNS][TILE], strength[TILE];
    for (int r = 0; r < GAS; ++r) {
        const double *a = t->c[s->pairs[2 * r]], *b = t->c[s->pairs[2 * r + 1]];
        double *by_a = slopes[s->pairs[2 * r]], *by_b = slopes[s->pairs[2 * r + 1]];
        pick(strength, s->in_volume + r * s->own, count, here, first);
        memset(slopes, 0, sizeof slopes);
        TOGETHER(n, count) {
            const double one = POSITIVE(a[n]), two = POSITIVE(b[n]);
            events[r][n] = strength[n] * one * two;
            by_a[n] += a[n] > 0.0 ? strength[n] * two : 0.0;
            by_b[n] += b[n] > 0.0 ? strength[n] * one : 0.0;
        }
        count_in(t, count, s->made_in_volume + r * UNKNOWNS, events[r], slopes);
    }
}

/* Events on surfaces at concentrations c; what they make and its slopes to s->made and s->slope. */
INSIDE void on_all_surfaces(const Reacting *s, double dt, const double *theta, const double *c, double *surface_events)
{
    Tile t;
    double events[ROOM(SURFACE)][TILE];
    for (long first = 0; first < s->reactive; first += TILE) {
        const long count = s->reactive - first < TILE ? s->reactive - first : TILE, size = count * sizeof(double);
        clear(&t);
        EACH(i) pick(t.c[i], c + i * s->own, count, s->cells + first, 0);
        on_surfaces(s, &t, count, 0, first, dt, theta, events);
        for (int r = 0; r < SURFACE; ++r)
            memcpy(surface_events + r * s->reactive + first, events[r], size);
        EACH(i) {
            memcpy(s->made + i * s->reactive + first, t.made[i], size);
            EACH(j) memcpy(s->slope + (i * UNKNOWNS + j) * s->reactive + first, t.slope[i][j], size);
        }
    }
}

/* Events at concentrations c, what the equations miss there, in place of fluxes in `residual`, and their slopes in one cell to `blocks`.
   sums: |residual|, |diagonal c|; lowest, largest concentration; of two unknowns the largest share of a change that comes back to one by
   way of the other. */
FAST void weigh(const Reacting *s, double dt, const double *theta, const double *c, const double *diagonal, const double *rhs,
                double *residual, double *blocks, double *surface_events, double *gas_events, double *sums)
{
    Tile all;
    double in_gas[ROOM(GAS)][TILE];
    double missed = 0.0, carried = 0.0, lowest = INFINITY, largest = -INFINITY, mutual = 0.0;
    long next = 0;
    on_all_surfaces(s, dt, theta, c, surface_events);
    for (long first = 0; first < s->own; first += TILE) {
        const long count = s->own - first < TILE ? s->own - first : TILE;
        clear(&all);
        EACH(i) memcpy(all.c[i], c + i * s->own + first, count * sizeof(double));
        in_volume(s, &all, count, 0, first, in_gas);
        for (int r = 0; r < GAS; ++r)
            memcpy(gas_events + r * s->own + first, in_gas[r], count * sizeof(double));
        const long begin = next;
        while (next < s->reactive && s->cells[next] < first + count)
            ++next;
        EACH(i) {
            CELLS(n, next - begin) all.made[i][s->cells[begin + n] - first] += s->made[i * s->reactive + begin + n];
            EACH(j) CELLS(n, next - begin)
                all.slope[i][j][s->cells[begin + n] - first] += s->slope[(i * UNKNOWNS + j) * s->reactive + begin + n];
        }
        EACH(i) {
            const double *d = diagonal + i * s->own + first, *right = rhs + i * s->own + first, *now = all.c[i];
            double *left = residual + i * s->own + first, *block = blocks + first * UNKNOWNS * UNKNOWNS + i * UNKNOWNS;
#pragma omp simd reduction(+ : missed, carried) reduction(min : lowest) reduction(max : largest)
            CELLS(n, count) {
                left[n] = (left[n] - right[n]) - all.made[i][n];
                all.slope[i][i][n] = all.slope[i][i][n] - d[n];
                missed += fabs(left[n]);
                carried += fabs(d[n] * now[n]);
                lowest = now[n] < lowest ? now[n] : lowest;
                largest = now[n] > largest ? now[n] : largest;
            }
            EACH(j) CELLS(n, count) block[n * UNKNOWNS * UNKNOWNS + j] = -all.slope[i][j][n];
        }
#if UNKNOWNS == 2
#pragma omp simd reduction(max : mutual)
        CELLS(n, count) {
            const double back = fabs(all.slope[0][1][n] * all.slope[1][0][n] / (all.slope[0][0][n] * all.slope[1][1][n]));
            mutual = back > mutual ? back : mutual;
        }
#endif
    }
    sums[0] = missed;
    sums[1] = carried;
    sums[2] = lowest;
    sums[3] = largest;
    sums[4] = mutual;
}

/* x of matrix x = rhs in place of rhs, by elimination with the largest pivot of a column; not finite where there is none. */
INSIDE void solve_cell(double matrix[UNKNOWNS][UNKNOWNS], double *rhs)
{
    EACH(k) {
        int pivot = k;
        for (int i = k + 1; i < UNKNOWNS; ++i)
            if (fabs(matrix[i][k]) > fabs(matrix[pivot][k]))
                pivot = i;
        if (pivot != k) {
            EACH(j) {
                const double kept = matrix[k][j];
                matrix[k][j] = matrix[pivot][j];
                matrix[pivot][j] = kept;
            }
            const double kept = rhs[k];
            rhs[k] = rhs[pivot];
            rhs[pivot] = kept;
        }
        for (int i = k + 1; i < UNKNOWNS; ++i) {
            const double times = matrix[i][k] / matrix[k][k];
            for (int j = k; j < UNKNOWNS; ++j)
                matrix[i][j] -= times * matrix[k][j];
            rhs[i] -= times * rhs[k];
        }
    }
    for (int k = UNKNOWNS - 1; k >= 0; --k) {
        for (int j = k + 1; j < UNKNOWNS; ++j)
            rhs[k] -= matrix[k][j] * rhs[j];
        rhs[k] /= matrix[k][k];
    }
}

/* Newton's method in `count` cells of a tile by themselves, as in balance_locally; `here` among those with sites, `there` among all. */
INSIDE void settle(const Reacting *s, const Limits *limits, Tile *t, long count, const long *here, const long *there, double dt,
                   const double *theta, const double *diagonal, double (*inflow)[TILE])
{
    double on_area[ROOM(SURFACE)][TILE], in_gas[ROOM(GAS)][TILE];
    long left = count;
    int active[TILE];
    CELLS(n, count) active[n] = 1;
    for (int tried = 0; tried < limits->tries && left; ++tried) {
        clear(t);
        on_surfaces(s, t, count, here, 0, dt, theta, on_area);
        in_volume(s, t, count, there, 0, in_gas);
        CELLS(n, count) {
            double matrix[UNKNOWNS][UNKNOWNS], change[UNKNOWNS];
            int loose = 0, finite = 1;
            if (!active[n])
                continue;
            EACH(i) {
                const double d = diagonal[i * s->own + there[n]], held = d * t->c[i][n];
                change[i] = held - inflow[i][n] - t->made[i][n];
                loose |= fabs(change[i]) > limits->tight * (held + inflow[i][n]) + limits->idle;
                EACH(j) matrix[i][j] = (i == j ? d : 0.0) - t->slope[i][j][n];
            }
            if (loose)
                solve_cell(matrix, change);
            EACH(i) finite &= isfinite(change[i]);
            if (!loose || !finite) {
                active[n] = 0;
                --left;
                continue;
            }
            EACH(i) {
                const double now = t->c[i][n], after = fmax(now - change[i], limits->shrink * now);
                t->c[i][n] = fmax(after, limits->lowest);
            }
        }
    }
}

/* Let concentrations c balance with what flows in under them, by `flux`, where so many sites react that those of a cell may run out. */
FAST void balance(const Reacting *s, const Limits *limits, double dt, const double *theta, const double *diagonal, const double *rhs,
                  const double *flux, double *c)
{
    Tile t;
    double inflow[UNKNOWNS][TILE];
    long here[TILE], there[TILE], count = 0;
    for (long cell = 0; cell < s->reactive; ++cell) {
        const long k = s->cells[cell];
        int bends = 0;
        EACH(i) {
            const double held = diagonal[i * s->own + k] * c[i * s->own + k];
            inflow[i][count] = POSITIVE(held - flux[i * s->own + k] + rhs[i * s->own + k]);
        }
        for (int r = 0; r < SURFACE; ++r) {
            const long i = s->gas[r], at = i * s->own + k;
            const double most = fmax(c[at], inflow[i][count] / diagonal[at]);
            bends |= dt * s->turnover[r * s->reactive + cell] * POSITIVE(most) * theta[s->site[r] * s->reactive + cell] > limits->bent;
        }
        if (bends) {
            EACH(i) t.c[i][count] = fmax(c[i * s->own + k], limits->lowest);
            here[count] = cell;
            there[count++] = k;
        }
        if (count == TILE || (count && cell == s->reactive - 1)) {
            settle(s, limits, &t, count, here, there, dt, theta, diagonal, inflow);
            EACH(i) CELLS(n, count) c[i * s->own + there[n]] = inflow[i][n] > 0.0 ? t.c[i][n] : 0.0;
            count = 0;
        }
    }
}
