/* What mpm.transport.closed_forms asks of C, read by the compiler and by cffi alike. Shapes are in closed_forms.c. */

/* SURFACE reactions on two kinds of sites and GAS reactions of two gases among UNKNOWNS of them. */
typedef struct {
    long own, reactive;            /* cells of this rank, and those of them with sites */
    const long *cells;             /* (reactive,) their numbers, ascending */
    const long *gas, *site;        /* (SURFACE,) what meets */
    const double *gain;            /* (SURFACE,) places that an event makes of the other kind of site */
    const double *turnover;        /* (SURFACE, reactive) k/n_s [m3/mol/s] */
    const double *on_area;         /* (SURFACE, reactive) k times the area of a cell [m2/s, per metre of depth] */
    const double *made_on_area;    /* (SURFACE, UNKNOWNS) of each gas per event */
    const long *pairs;             /* (GAS, 2) gases that meet */
    const double *in_volume;       /* (GAS, own) k times the volume that they meet in */
    const double *made_in_volume;  /* (GAS, UNKNOWNS) */
    double *made, *slope;          /* room for what is made on surfaces, (UNKNOWNS, reactive) and (UNKNOWNS, UNKNOWNS, reactive) */
} Reacting;

/* When a cell balances by itself. */
typedef struct {
    int tries;
    double bent, idle, tight, shrink, lowest;
} Limits;

void weigh(const Reacting *s, double dt, const double *theta, const double *c, const double *diagonal, const double *rhs, double *residual,
           double *blocks, double *surface_events, double *gas_events, double *sums);
void balance(const Reacting *s, const Limits *limits, double dt, const double *theta, const double *diagonal, const double *rhs,
             const double *flux, double *c);
