#include "base/room.h"
#include "coarse/tree.h"
#include <petsc/private/matimpl.h>

/*
   Elimination along the tree of coarse/treeplan.c. A rank eliminates the unknowns that it alone has. Its contribution block, a dense matrix of those
   that it shares, joins that of its partner; in this joint the unknowns of these two ranks alone are eliminated; and so on. With i these unknowns, b
   the others of the joint:

     factor:    K_ii = L L^t,   Z = K_bi L^-t,   S = K_bb - Z Z^t, the contribution block, which goes to the next joint;
     forward:   y = L^-1 g_i,   g_b - Z y is sent to the next joint;
     backward:  u_b comes back,   u_i = L^-t (y - Z^t u_b).

   So a solve takes one message each way for each of the groups that join, and a rank keeps no more than the columns of one joint.

   S is never stored as a whole. Unknowns are listed in the order in which joints eliminate them, so that the columns of both groups arrive in the order
   of the front to which they are added. A panel of columns is complete once these have arrived and earlier panels have updated it (left-looking).
   Panels of the interior are then eliminated and kept; the others are sent on, one by one.

   There is no deadlock. Parts send their contribution blocks by nonblocking messages, and wait for these only when their joints are done. Take the
   topmost joint that waits: it has received all that a group below has sent so far. So the joint of that group does not wait to send, but to receive
   from a group of its own; and so on down to a part, which has sent everything, or still computes.
*/

/*
   Contribution block of a part: its lower triangle, rows in the order of the joints, see LatinLowerAt(). It is sent by messages of LATIN_FRONT_PANEL
   columns: large enough to hide latency, small beside a front
*/
typedef struct {
  PetscInt     n;
  PetscScalar *a;
  PetscScalar *own;  /* memory of a, to be freed, or NULL */
  Mat          part; /* matrix that has the memory of a, to be destroyed, or NULL */
  PetscInt     messages;
  MPI_Request *sent; /* [messages] */
  PetscMPIInt *gone; /* [messages] work: messages that have been sent */
} LatinContribution;

/* Releases the memory of the columns of a message, which nobody reads any more */
static void LatinContributionEmpty(const LatinContribution *block, PetscInt message)
{
  const size_t start = LatinPanelSize(1, block->n, LATIN_FRONT_PANEL * message), end = LatinPanelSize(1, block->n, PetscMin(LATIN_FRONT_PANEL * (message + 1), block->n));

  LatinRoomRelease(block->a + start, (end - start) * sizeof(*block->a));
}

/* Starts to send the whole block to the rank of the joint */
static PetscErrorCode LatinContributionSend_Private(const LatinTree *tree, LatinContribution *block)
{
  PetscFunctionBegin;
  block->messages = (block->n + LATIN_FRONT_PANEL - 1) / LATIN_FRONT_PANEL;
  PetscCall(PetscMalloc2(block->messages, &block->sent, block->messages, &block->gone));
  for (PetscInt m = 0; m < block->messages; m++) {
    const size_t start = LatinPanelSize(1, block->n, LATIN_FRONT_PANEL * m), end = LatinPanelSize(1, block->n, PetscMin(LATIN_FRONT_PANEL * (m + 1), block->n));
    PetscMPIInt  length;

    PetscCall(PetscMPIIntCast((PetscInt)(end - start), &length));
    PetscCallMPI(MPI_Isend(block->a + start, length, MPIU_SCALAR, tree->to, 0, tree->comm, &block->sent[m]));
  }
  PetscFunctionReturn(0);
}

/* Releases the memory of columns that have been sent */
static PetscErrorCode LatinContributionSent_Private(LatinContribution *block)
{
  PetscMPIInt count = 0;

  PetscFunctionBegin;
  if (block->messages) PetscCallMPI(MPI_Testsome((PetscMPIInt)block->messages, block->sent, &count, block->gone, MPI_STATUSES_IGNORE));
  for (PetscMPIInt k = 0; k < count; k++) LatinContributionEmpty(block, block->gone[k]); /* negative (MPI_UNDEFINED) if nothing is being sent */
  PetscFunctionReturn(0);
}

/* Waits until the whole block has been sent, and frees it */
static PetscErrorCode LatinContributionFree_Private(LatinContribution *block)
{
  PetscFunctionBegin;
  if (block->messages) PetscCallMPI(MPI_Waitall((PetscMPIInt)block->messages, block->sent, MPI_STATUSES_IGNORE));
  PetscCall(PetscFree2(block->sent, block->gone));
  PetscCall(PetscFree(block->own));
  PetscCall(MatDestroy(&block->part));
  PetscFunctionReturn(0);
}

/* Contribution block of a group, which arrives at a joint column by column */
typedef struct {
  PetscMPIInt        rank;
  PetscInt           n, next; /* number of columns; next one */
  const PetscInt    *at;      /* [n] rows of the columns in the front */
  const PetscScalar *column;  /* column `next`, from its diagonal on */
  PetscScalar       *buffer;  /* room for a message; NULL: the block is on this rank */
} LatinIncoming;

static PetscErrorCode LatinIncomingCreate_Private(const LatinTree *tree, PetscInt k, LatinIncoming *incoming)
{
  const LatinJoint *joint = tree->joint;

  PetscFunctionBegin;
  *incoming = (LatinIncoming){.rank = joint->from[k], .n = joint->n[k], .at = joint->at + (k ? joint->n[0] : 0)};
  if (incoming->rank != tree->rank) PetscCall(PetscMalloc1(LATIN_FRONT_PANEL * incoming->n, &incoming->buffer));
  PetscFunctionReturn(0);
}

/* Gets the next message of columns of a group: receives it, or finds it in the block of this rank, and releases what has been read */
static PetscErrorCode LatinIncomingNext_Private(const LatinTree *tree, const LatinContribution *block, LatinIncoming *incoming)
{
  const PetscInt message = incoming->next / LATIN_FRONT_PANEL;
  PetscMPIInt    length;

  PetscFunctionBegin;
  if (incoming->buffer) {
    PetscCall(PetscMPIIntCast(LATIN_FRONT_PANEL * incoming->n, &length));
    PetscCallMPI(MPI_Recv(incoming->buffer, length, MPIU_SCALAR, incoming->rank, 0, tree->comm, MPI_STATUS_IGNORE));
    incoming->column = incoming->buffer;
  } else {
    if (message) LatinContributionEmpty(block, message - 1);
    incoming->column = block->a + LatinPanelSize(1, incoming->n, incoming->next);
  }
  PetscFunctionReturn(0);
}

/* Adds the columns of a group that come before column `last` of the front to the panel that begins with column c: extend-add. block: that of this rank */
static PetscErrorCode LatinIncomingAdd_Private(const LatinTree *tree, const LatinContribution *block, PetscInt c, PetscInt last, LatinIncoming *incoming, PetscScalar panel[])
{
  const PetscInt n = incoming->n, *at = incoming->at;

  PetscFunctionBegin;
  for (; incoming->next < n && at[incoming->next] < last; incoming->next++) {
    const PetscInt j  = incoming->next;
    PetscScalar   *to = panel + (size_t)(tree->joint->rows - c) * (size_t)(at[j] - c) - c;

    if (j % LATIN_FRONT_PANEL == 0) PetscCall(LatinIncomingNext_Private(tree, block, incoming));
    for (PetscInt i = j; i < n; i++) to[at[i]] += incoming->column[i - j];
    incoming->column += n - j;
  }
  PetscFunctionReturn(0);
}

/* Updates `some` columns to[], rows from r on, by the interior columns before them (left-looking) */
static PetscErrorCode LatinJointUpdate_Private(const LatinJoint *joint, const PetscScalar L[], PetscInt r, PetscInt some, PetscScalar to[])
{
  const PetscScalar  one = 1.0, minus = -1.0;
  const PetscBLASInt height = (PetscBLASInt)(joint->rows - r), columns = (PetscBLASInt)some;

  PetscFunctionBegin;
  for (PetscInt c = 0; c < PetscMin(r, joint->interior); c += LATIN_FRONT_PANEL) {
    const PetscBLASInt wide = (PetscBLASInt)PetscMin(LATIN_FRONT_PANEL, joint->interior - c), ld = (PetscBLASInt)(joint->rows - c);
    const PetscScalar *Z = L + LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows, c) + r;

    PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &height, &columns, &wide, &minus, Z, &ld, Z, &ld, &one, to, &height));
  }
  PetscFunctionReturn(0);
}

/* Eliminates a complete panel of `some` interior columns from c on. *bad: it is not positive definite */
static PetscErrorCode LatinJointEliminate_Private(const LatinJoint *joint, PetscInt c, PetscInt some, PetscScalar panel[], PetscBool *bad)
{
  const PetscScalar  one  = 1.0;
  const PetscBLASInt wide = (PetscBLASInt)some, height = (PetscBLASInt)(joint->rows - c), below = height - wide;
  PetscBLASInt       info = 0;

  PetscFunctionBegin;
  PetscCallBLAS("LAPACKpotrf", LAPACKpotrf_("L", &wide, panel, &height, &info));
  if (info) *bad = PETSC_TRUE;
  if (info) PetscFunctionReturn(0);
  if (below) PetscCallBLAS("BLAStrsm", BLAStrsm_("R", "L", "T", "N", &below, &wide, &one, panel, &height, panel + wide, &height));
  for (PetscInt k = 1; k < some; k++) PetscCall(PetscArrayzero(panel + (size_t)height * (size_t)k, k));
  PetscFunctionReturn(0);
}

/* Sends `some` columns of the contribution block from c on to the next joint, each from its diagonal on. Overwrites panel */
static PetscErrorCode LatinJointSend_Private(const LatinTree *tree, PetscInt c, PetscInt some, PetscScalar panel[])
{
  const PetscInt height = tree->joint->rows - c;
  PetscInt       n      = 0;
  PetscMPIInt    length;

  PetscFunctionBegin;
  for (PetscInt k = 0; k < some; n += height - k++) PetscCall(PetscArraymove(panel + n, panel + (size_t)(height + 1) * (size_t)k, height - k));
  PetscCall(PetscMPIIntCast(n, &length));
  PetscCallMPI(MPI_Send(panel, length, MPIU_SCALAR, tree->joint->to, 0, tree->comm));
  PetscFunctionReturn(0);
}

/* Creates the front of a joint as the only front of localsolvers/fronts.c, which lists all rows */
static PetscErrorCode LatinJointFront_Private(LatinJoint *joint)
{
  const PetscInt rows = joint->rows;

  PetscFunctionBegin;
  if (joint->order) PetscFunctionReturn(0);
  PetscCall(PetscMalloc1(rows, &joint->order));
  for (PetscInt r = 0; r < rows; r++) joint->order[r] = r;
  joint->first[0] = 0;
  joint->first[1] = rows;
  PetscCall(LatinFrontsCreate(rows, rows - joint->interior, 1, joint->order, joint->first, joint->first, joint->order, &joint->front));
  PetscFunctionReturn(0);
}

/* Keeps the interior columns L as the factor of the joint; in single precision if `rounded` and their pivots fit. Releases the memory of L */
static PetscErrorCode LatinJointKeep_Private(LatinJoint *joint, PetscBool rounded, PetscScalar L[])
{
  PetscFunctionBegin;
  for (PetscInt c = 0; c < joint->interior && rounded; c++) rounded = LatinFrontPivot(L[LatinPanelColumnAt(LATIN_FRONT_PANEL, joint->rows, c) + (size_t)c]);
  PetscCall(LatinFrontsFill(&joint->front, rounded ? LATIN_ROUNDED : LATIN_DOUBLE, L));
  PetscFunctionReturn(0);
}

/* Creates the factor of the part, with the shared rows last, and analyses it */
static PetscErrorCode LatinTreeAnalyse_Private(LatinTree *tree, Mat A, const MatFactorInfo *info)
{
  IS kept;

  PetscFunctionBegin;
  PetscCall(MatGetFactor(A, LATIN_CHOLESKY, MAT_FACTOR_CHOLESKY, &tree->part));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, tree->rest, tree->row, PETSC_COPY_VALUES, &kept));
  if (tree->rest) PetscCall(MatFactorSetSchurIS(tree->part, kept));
  PetscCall(LatinCholeskySetLower(tree->part));
  PetscCall(ISDestroy(&kept));
  PetscCall(MatCholeskyFactorSymbolic(tree->part, A, NULL, info));
  PetscFunctionReturn(0);
}

/*
   Computes the contribution block of a part with rows of its own, which its factor eliminates; its rows ascend as in the part. Takes K over. *bad: the
   part is not positive definite
*/
static PetscErrorCode LatinTreeSparse_Private(LatinTree *tree, Mat K, LatinContribution *block, PetscBool *bad)
{
  MatFactorInfo info;
  PetscBool     sparse;
  Mat           A;

  PetscFunctionBegin;
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQAIJ, &sparse));
  if (sparse) A = K;
  else {
    PetscCall(MatConvert(K, MATSEQAIJ, MAT_INITIAL_MATRIX, &A));
    PetscCall(MatDestroy(&K));
  }
  PetscCall(MatFactorInfoInitialize(&info));
  if (!tree->part) PetscCall(LatinTreeAnalyse_Private(tree, A, &info));
  PetscCall(MatCholeskyFactorNumeric(tree->part, A, &info));
  *bad = (PetscBool)(tree->part->factorerrortype != MAT_FACTOR_NOERROR);
  PetscCall(MatDestroy(&A));
  PetscCall(LatinCholeskyTakeLower(tree->part, &block->own));
  block->a = block->own;
  PetscFunctionReturn(0);
}

/* Makes all of K the contribution block of a part without rows of its own. Takes K over, and its memory unless K is referenced elsewhere */
static PetscErrorCode LatinTreeDense_Private(LatinTree *tree, Mat K, LatinContribution *block)
{
  const size_t n      = (size_t)tree->rest;
  PetscInt     owners = 1, ld;
  PetscBool    dense, lower;
  PetscScalar *from;

  PetscFunctionBegin;
  block->part = K;
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSHELL, &lower));
  if (lower) PetscCall(MatShellGetContext(K, &block->a));
  if (lower) PetscFunctionReturn(0);
  PetscCall(PetscObjectTypeCompare((PetscObject)K, MATSEQDENSE, &dense));
  if (dense) PetscCall(PetscObjectGetReference((PetscObject)K, &owners));
  else {
    PetscCall(MatConvert(K, MATSEQDENSE, MAT_INITIAL_MATRIX, &block->part));
    PetscCall(MatDestroy(&K));
  }
  PetscCall(MatDenseGetLDA(block->part, &ld));
  PetscCall(MatDenseGetArrayRead(block->part, (const PetscScalar **)&from)); /* the matrix keeps it, and may be overwritten */
  if (owners > 1) PetscCall(PetscMalloc1(LatinPanelSize(1, tree->rest, tree->rest), &block->own));
  block->a = owners > 1 ? block->own : from;
  for (size_t c = 0; c < n; c++)
    for (size_t r = c; r < n; r++) block->a[LatinLowerAt(tree->rest, (PetscInt)c) + r] = from[r + (size_t)ld * c];
  if (owners > 1) PetscCall(MatDestroy(&block->part));
  else LatinRoomRelease(from + LatinPanelSize(1, tree->rest, tree->rest), ((size_t)ld * n - LatinPanelSize(1, tree->rest, tree->rest)) * sizeof(*from));
  PetscFunctionReturn(0);
}

/* Moves the entries along that cycle of the permutation which entry (r, c) of a lower triangle is in, and marks them in moved[] */
static void LatinContributionCycle(PetscInt n, const PetscInt at[], PetscInt r, PetscInt c, PetscScalar a[], char moved[])
{
  const size_t      start = LatinLowerAt(n, c) + (size_t)r;
  const PetscScalar first = a[start];

  for (size_t to = start, from; !moved[to]; to = from) {
    const PetscInt high = PetscMax(at[r], at[c]), low = PetscMin(at[r], at[c]);

    from      = LatinLowerAt(n, low) + (size_t)high;
    a[to]     = from == start ? first : a[from];
    moved[to] = 1;
    r         = high;
    c         = low;
  }
}

/* Permutes a lower triangle: row and column at[r] become row and column r. In place, as it may be as large as the factor */
static PetscErrorCode LatinContributionPermute_Private(PetscInt n, const PetscInt at[], PetscScalar a[])
{
  PetscBool sorted = PETSC_TRUE;
  char     *moved; /* for each entry, whether it is in place */

  PetscFunctionBegin;
  for (PetscInt r = 0; r < n && sorted; r++) sorted = (PetscBool)(at[r] == r);
  if (sorted) PetscFunctionReturn(0);
  PetscCall(PetscCalloc1(LatinPanelSize(1, n, n), &moved));
  for (PetscInt c = 0; c < n; c++)
    for (PetscInt r = c; r < n; r++) LatinContributionCycle(n, at, r, c, a, moved);
  PetscCall(PetscFree(moved));
  PetscFunctionReturn(0);
}

/* Returns the positions at[] of the shared rows among all of them, ascending */
static PetscErrorCode LatinTreePositions_Private(const LatinTree *tree, PetscInt at[])
{
  PetscInt *place; /* [n] 1 + position of a row of the part; 0: not shared */

  PetscFunctionBegin;
  PetscCall(PetscCalloc1(tree->n, &place));
  for (PetscInt i = 0; i < tree->rest; i++) place[tree->row[i]] = 1;
  for (PetscInt r = 0, k = 0; r < tree->n; r++)
    if (place[r]) place[r] = ++k;
  for (PetscInt i = 0; i < tree->rest; i++) at[i] = place[tree->row[i]] - 1;
  PetscCall(PetscFree(place));
  PetscFunctionReturn(0);
}

/* Computes the contribution block of this rank's part, in the order of the joints. Takes K over */
static PetscErrorCode LatinTreePart_Private(LatinTree *tree, Mat K, LatinContribution *block, PetscBool *bad)
{
  PetscInt *at;

  PetscFunctionBegin;
  *block = (LatinContribution){.n = tree->rest};
  if (tree->rest < tree->n) PetscCall(LatinTreeSparse_Private(tree, K, block, bad));
  else PetscCall(LatinTreeDense_Private(tree, K, block));
  PetscCall(PetscMalloc1(tree->rest, &at));
  PetscCall(LatinTreePositions_Private(tree, at));
  PetscCall(LatinContributionPermute_Private(tree->rest, at, block->a));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(0);
}

/*
   Factors the front of the joint, panel by panel, from the blocks that arrive and that of this rank: panels of the interior are eliminated, the others
   are sent on, even if the front is not positive definite (*bad), as the next joint waits
*/
static PetscErrorCode LatinTreeJoin_Private(LatinTree *tree, PetscBool rounded, LatinContribution *block, PetscBool *bad)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt rows = joint->rows, in = joint->interior;
  PetscScalar   *L, *S;
  LatinIncoming  incoming[2];

  PetscFunctionBegin;
  PetscCall(LatinJointFront_Private(joint));
  PetscCall(LatinRoomDestroy_Private(&joint->front.factor));
  PetscCall(PetscMalloc1(joint->front.panel[1], &L));
  PetscCall(PetscMalloc1(LATIN_FRONT_PANEL * (rows - in), &S));
  for (PetscInt k = 0; k < 2; k++) PetscCall(LatinIncomingCreate_Private(tree, k, &incoming[k]));
  for (PetscInt c = 0, wide; c < rows; c += wide) {
    const PetscBool inside = (PetscBool)(c < in);
    PetscScalar    *panel  = inside ? L + LatinPanelAt(LATIN_FRONT_PANEL, rows, c) : S;

    wide = PetscMin(LATIN_FRONT_PANEL, (inside ? in : rows) - c);
    PetscCall(PetscArrayzero(panel, (size_t)(rows - c) * (size_t)wide));
    for (PetscInt k = 0; k < 2; k++) PetscCall(LatinIncomingAdd_Private(tree, block, c, c + wide, &incoming[k], panel));
    if (!*bad) PetscCall(LatinJointUpdate_Private(joint, L, c, wide, panel));
    if (!inside) PetscCall(LatinJointSend_Private(tree, c, wide, panel));
    else if (!*bad) PetscCall(LatinJointEliminate_Private(joint, c, wide, panel, bad));
    PetscCall(LatinContributionSent_Private(block));
  }
  for (PetscInt k = 0; k < 2; k++) PetscCall(PetscFree(incoming[k].buffer));
  PetscCall(PetscFree(S));
  PetscCall(PetscLogFlops((double)in * ((double)in * in / 3.0 + (double)in * (rows - in) + PetscSqr((double)(rows - in)))));
  PetscCall(LatinJointKeep_Private(joint, rounded, L));
  PetscCall(PetscFree(L));
  PetscFunctionReturn(0);
}

/*
   Factors the sum of the parts K, which it takes over. rounded: joints are stored in single precision. *bad, on all ranks or on none: it is not
   positive definite. Collective on tree->comm
*/
PetscErrorCode LatinTreeFactor_Private(LatinTree *tree, PetscBool rounded, Mat K, PetscBool *bad)
{
  LatinContribution block;

  PetscFunctionBegin;
  *bad = PETSC_FALSE;
  PetscCall(LatinTreePart_Private(tree, K, &block, bad));
  if (tree->to != tree->rank) PetscCall(LatinContributionSend_Private(tree, &block));
  if (tree->joint) PetscCall(LatinTreeJoin_Private(tree, rounded, &block, bad));
  PetscCall(LatinContributionFree_Private(&block));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, bad, 1, LATIN_MPI_BOOL, MPI_LOR, tree->comm));
  PetscFunctionReturn(0);
}

/* Sends w[n] to another rank or receives it: forces of a group on the way up, displacements on the way down. Nothing if they stay on this rank */
static PetscErrorCode LatinTreePass_Private(const LatinTree *tree, PetscMPIInt other, PetscInt n, PetscBool send)
{
  PetscMPIInt length;

  PetscFunctionBegin;
  if (other < 0 || other == tree->rank) PetscFunctionReturn(0);
  PetscCall(PetscMPIIntCast(n, &length));
  if (send) PetscCallMPI(MPI_Send(tree->w, length, MPIU_SCALAR, other, 0, tree->comm));
  else PetscCallMPI(MPI_Recv(tree->w, length, MPIU_SCALAR, other, 0, tree->comm, MPI_STATUS_IGNORE));
  PetscFunctionReturn(0);
}

/*
   Performs both halves of the solve at the joint: adds the forces of both groups, eliminates, sends the rest up, receives displacements and gives each
   group its own. tree->w: in, forces of the part of this rank; out, its displacements, if its joint is this one
*/
static PetscErrorCode LatinTreeJoint_Private(LatinTree *tree)
{
  LatinJoint    *joint = tree->joint;
  const PetscInt out   = joint->rows - joint->interior;
  PetscScalar   *w     = tree->w;

  PetscFunctionBegin;
  PetscCall(PetscArrayzero(joint->x, joint->rows));
  for (PetscInt p = 0; p < 2; p++) { /* the group of this rank first: messages overwrite w */
    const PetscInt  k  = joint->from[1] == tree->rank ? 1 - p : p;
    const PetscInt *at = joint->at + (k ? joint->n[0] : 0);

    PetscCall(LatinTreePass_Private(tree, joint->from[k], joint->n[k], PETSC_FALSE));
    for (PetscInt i = 0; i < joint->n[k]; i++) joint->x[at[i]] += w[i];
  }
  PetscCall(LatinFrontsSolve(&joint->front, PETSC_TRUE, PETSC_FALSE, 1, joint->x, 0, NULL));
  PetscCall(PetscArraycpy(w, joint->x + joint->interior, out));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_TRUE));
  PetscCall(LatinTreePass_Private(tree, joint->to, out, PETSC_FALSE));
  PetscCall(PetscArraycpy(joint->x + joint->interior, w, out));
  PetscCall(LatinFrontsSolve(&joint->front, PETSC_FALSE, PETSC_TRUE, 1, joint->x, 0, NULL));
  for (PetscInt p = 0; p < 2; p++) { /* the group of this rank last: its result stays in w */
    const PetscInt  k  = joint->from[1] == tree->rank ? p : 1 - p;
    const PetscInt *at = joint->at + (k ? joint->n[0] : 0);

    for (PetscInt i = 0; i < joint->n[k]; i++) w[i] = joint->x[at[i]];
    PetscCall(LatinTreePass_Private(tree, joint->from[k], joint->n[k], PETSC_TRUE));
  }
  PetscFunctionReturn(0);
}

/* Computes x = A^-1 b; each rank has the rows that it owns. Collective on tree->comm */
PetscErrorCode LatinTreeSolve_Private(LatinTree *tree, const PetscScalar b[], PetscScalar x[])
{
  PetscReal energy = 0.0;

  PetscFunctionBegin;
  for (PetscInt r = 0; r < tree->n; r++) tree->g[r] = tree->owned[r] < 0 ? 0.0 : b[tree->owned[r]];
  if (tree->part) PetscCall(LatinCholeskyForward(tree->part, tree->g, &energy));
  for (PetscInt i = 0; i < tree->rest; i++) tree->w[i] = tree->g[tree->row[i]];
  PetscCall(LatinTreePass_Private(tree, tree->to, tree->rest, PETSC_TRUE));
  if (tree->joint) PetscCall(LatinTreeJoint_Private(tree));
  PetscCall(LatinTreePass_Private(tree, tree->to, tree->rest, PETSC_FALSE));
  for (PetscInt i = 0; i < tree->rest; i++) tree->g[tree->row[i]] = tree->w[i];
  if (tree->part) PetscCall(LatinCholeskyBackward(tree->part, tree->g, &energy));
  for (PetscInt r = 0; r < tree->n; r++)
    if (tree->owned[r] >= 0) x[tree->owned[r]] = tree->g[r];
  PetscFunctionReturn(0);
}

PetscErrorCode LatinTreeReset_Private(LatinTree *tree)
{
  PetscFunctionBegin;
  if (tree->joint) {
    PetscCall(PetscFree(tree->joint->at));
    PetscCall(PetscFree(tree->joint->order));
    PetscCall(LatinFrontsDestroy(&tree->joint->front));
    PetscCall(PetscFree(tree->joint->x));
  }
  PetscCall(PetscFree(tree->joint));
  PetscCall(PetscFree2(tree->owned, tree->row));
  PetscCall(PetscFree2(tree->g, tree->w));
  PetscCall(MatDestroy(&tree->part));
  if (tree->comm != MPI_COMM_NULL) PetscCallMPI(MPI_Comm_free(&tree->comm));
  tree->comm = MPI_COMM_NULL;
  PetscFunctionReturn(0);
}
