/* Messages between the boxes of neighbours, and sums over all, without the interpreter between a sweep and what it sends.

   MPI comes as the addresses of its functions in the library that mpi4py has loaded, and its handles as numbers: they are integers in
   some libraries and pointers in others, of HANDLE bytes, and nobody's header is needed. */

#if HANDLE == 4
typedef int Handle;
#else
typedef void *Handle;
#endif
typedef int (*Isend)(const void *, int, Handle, int, int, Handle, void *);
typedef int (*Recv)(void *, int, Handle, int, int, Handle, void *);
typedef int (*Wait)(void *, void *);
typedef int (*Allreduce)(const void *, void *, int, Handle, Handle, Handle);
enum { START, END };

/* Columns from `first` to before `end` that are done in one go; whether they are at a side with a seam. */
typedef struct {
    int first, end, at[2];
} Piece;

/* Those of a box in order, at most three: columns at seams by themselves, the others between them in one. Returns their number. */
static int pieces_of(const Box *box, Piece *pieces)
{
    const int last = box->columns, seam[2] = {box->neighbour[START] >= 0, box->neighbour[END] >= 0};
    int cuts[4] = {0}, count = 0;
    if (seam[START] && last > 1)
        cuts[++count] = 1;
    if (seam[END] && last - 1 > cuts[count])
        cuts[++count] = last - 1;
    if (last > cuts[count])
        cuts[++count] = last;
    for (int i = 0; i < count; ++i)
        pieces[i] = (Piece){cuts[i], cuts[i + 1], {seam[START] && cuts[i] == 0, seam[END] && cuts[i + 1] == last}};
    return count;
}

static void told(Box *box, int error)
{
    if (error && !box->error)
        box->error = error;
}

/* Wait until what was given at `side` has gone. */
static void settled(Box *box, int side)
{
    if (box->open[side])
        told(box, ((Wait)box->wait)(&box->request[side], box->status));
    box->open[side] = 0;
}

static void finish(Box *box)
{
    settled(box, START);
    settled(box, END);
}

/* Send `lists` of `count` numbers each, `width` apart, across the seam at `side`; does not wait. */
static void give(Box *box, int side, int lists, int count, long width, const double *values)
{
    settled(box, side);
    double *message = box->sent[side];
    for (int i = 0; i < lists; ++i)
        memcpy(message + (long)i * count, values + i * width, count * sizeof(double));
    if (box->neighbour[side] == box->rank)
        return; /* it stays where it is until it is taken */
    const int error = ((Isend)box->isend)(message, lists * count, (Handle)box->number, box->neighbour[side], box->facing[side],
                                          (Handle)box->communicator, &box->request[side]);
    told(box, error);
    box->open[side] = !error;
}

/* Receive the like from across the seam at `side`, in the order in which it was given. */
static void take(Box *box, int side, int lists, int count, long width, double *values)
{
    const double *message = box->taken;
    if (box->neighbour[side] == box->rank)
        message = box->sent[box->facing[side]];
    else
        told(box, ((Recv)box->recv)(box->taken, lists * count, (Handle)box->number, box->neighbour[side], side,
                                    (Handle)box->communicator, box->status));
    for (int i = 0; i < lists; ++i)
        memcpy(values + i * width, message + (long)i * count, count * sizeof(double));
}

/* Sum over all ranks in place. */
static void add_up(Box *box, int count, double *values)
{
    double own[8];
    if (box->ranks == 1)
        return;
    memcpy(own, values, count * sizeof(double));
    told(box, ((Allreduce)box->allreduce)(own, values, count, (Handle)box->number, (Handle)box->sum, (Handle)box->communicator));
}
