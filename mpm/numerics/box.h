/* What mpm.numerics.box_matrix asks of C, read by the compiler and by cffi alike. Shapes are in box_matrix.c. */

/* The box of a rank, its neighbours (mpm/numerics/box.py), and how to speak to them: functions and handles of MPI. */
typedef struct {
    int rows, columns;
    int rank, ranks;
    int neighbour[2];              /* the rank at either side, or below zero */
    int facing[2];                 /* the side of its box at the seam */
    int earlier[2];                /* whether its work at the seam comes before ours */
    void *isend, *recv, *wait, *allreduce;
    long communicator, number, sum; /* handles; `number` is the type of a double */
    double *sent[2], *taken;       /* room for a message to either side, and for one that has come */
    void *request[2];              /* handles of what is under way */
    int open[2];                   /* whether anything is */
    double status[8];              /* room for a status, which nobody reads */
    int error;                     /* the first one that MPI has told of, or 0 */
} Box;

/* An incomplete factor of `parts` groups of UNKNOWNS that it couples, each of its own; room for its sweeps and for BiCGStab. */
typedef struct {
    int parts;
    const double *couplings;       /* (parts, UNKNOWNS, 4, cells), of one unknown times the inverse pivots */
    double *inverse, *excess;      /* P^-1 and P^-1 D - 2, (parts, cells, UNKNOWNS, UNKNOWNS) */
    int acting;                    /* pairs of parts of which one acts on the other */
    long *pairs;                   /* (acting, 3): the part acted on, that which acts, where the entries of the pair end */
    long *cells;                   /* of each entry */
    double *entries;               /* P^-1 D */
    double *own;                   /* (parts, cells), blocks within parts where there are several */
    double *x, *nothing;           /* (parts, UNKNOWNS, rows + cells + rows) */
    double *column, *beyond;       /* (parts, UNKNOWNS, rows) */
    double *edges;                 /* what boxes add to each other's pivots, (START, END, ours; parts, rows, UNKNOWNS, UNKNOWNS) */
    double *y, *p, *v, *t, *r, *shadow; /* (parts, UNKNOWNS, cells) */
} Factor;

void couple(long cells, const long *numbers, const double *taken, double *couplings);
void multiply(Box *box, const double *couplings, const double *blocks, double *x, double *result);
void miss(Box *box, const double *couplings, const double *blocks, double *x, const double *rhs, double *result, double *squares);
void renew(Box *box, Factor *factor, double relaxed, double least, const double *couplings, const double *blocks, double *swept);
void follow(Box *box, Factor *factor, double least, const double *blocks);
int solve(Box *box, Factor *factor, const double *rhs, double tolerance, double least, int limit, double *x, double *left);
